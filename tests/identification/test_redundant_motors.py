"""Identification of robots with more motors than freedoms: what these do against each other tells nothing."""

from functools import lru_cache
from typing import Any

import numpy as np
import pytest
from scipy import stats

import hybridyn
from hybridyn.identification.base_parameters import random_motions
from hybridyn.identification.estimators import estimate
from hybridyn.identification.long_measurements import triangular_factor
from hybridyn.identification.regressor import done_together, effort_rows
from hybridyn.identification.robot_with import with_parameters
from hybridyn.structure.robot import joint_position
from tests.identification.robots import base_of, flight, other_values, robot_of
from tests.robots.mechanisms import KINDS
from tests.support.samples import slow

REDUNDANT = [(kind, seed) for seed, (kind, one) in enumerate(KINDS.items()) if one.motors == "redundant"]
QUICK = ("four_bar_two_motors", "five_bar_four_motors")
CASES = [one if one[0] in QUICK else slow(*one) for one in REDUNDANT]
#: Base parameters without noise, of the largest.
EXACT = 1e-9
#: Probability with which a test of chance fails although all is right.
CHANCE = 1e-4
#: Runs with noise.
RUNS = 100


def against_each_other(robot: hybridyn.HybridRobot, q: np.ndarray, size: float, seed: int) -> np.ndarray:
    """Return efforts that redundant motors do against each other, shape (T, motors)."""
    together = done_together(robot, q)
    assert together is not None
    efforts = size * np.random.default_rng(seed).normal(size=(len(q), len(robot.motors)))
    return np.asarray(efforts - np.einsum("tij,tj->ti", together, efforts))


@lru_cache(maxsize=2)
def recorded(kind: str, seed: int) -> tuple[dict[str, Any], np.ndarray, np.ndarray]:
    """Return the log of another robot of a kind, its base parameters, and efforts that move nothing."""
    robot, base = robot_of(kind, seed), base_of(kind, seed)
    values = other_values(base, seed)
    time, (q, v, a) = flight(kind, seed)
    tau = hybridyn.idm(with_parameters(robot, values), q, v, a)
    log = {"time": time}
    for i, name in enumerate(robot.motors):
        log |= {f"{name}/position": joint_position(robot, q, name), f"{name}/effort": tau[:, i]}
        log[f"{name}/velocity"], log[f"{name}/acceleration"] = (x[:, robot.motor_v[i]] for x in (v, a))
    return log, base.combination @ values, against_each_other(robot, q, float(tau.std()), seed)


def with_efforts(kind: str, seed: int, more: np.ndarray, of: str = "effort") -> dict[str, Any]:
    """Return the log with more efforts, shape (T, motors), in the columns of a quantity."""
    log, motors = dict(recorded(kind, seed)[0]), robot_of(kind, seed).motors
    for name, own in zip(motors, more.T, strict=True):
        log[f"{name}/{of}"] = log.pop(f"{name}/effort") + own
    return log


@pytest.mark.parametrize(("kind", "seed"), CASES)
def test_what_moves_nothing_acts_as_the_controller_likes(kind: str, seed: int) -> None:
    """Numbers 30 % off the file's come back, however the motors share their load."""
    robot = robot_of(kind, seed)
    _, want, inner = recorded(kind, seed)
    for factor in (0.0, 5.0):
        found = hybridyn.identify(robot, with_efforts(kind, seed, factor * inner), effects=None)
        assert np.abs(found.values - want).max() <= EXACT * np.abs(want).max()
        assert found.fit.relative.max() <= EXACT
        assert any("redundant motors" in remark for remark in found.remarks)


@pytest.mark.parametrize(("kind", "seed"), CASES)
def test_what_moves_nothing_has_no_part_in_efforts_done_together(kind: str, seed: int) -> None:
    """Pi is a projector; it leaves the efforts needed, and takes those away that do no work on any motion."""
    robot = robot_of(kind, seed)
    q, v, a = (x[:20] for x in flight(kind, seed)[1])
    together = done_together(robot, q)
    assert together is not None
    np.testing.assert_allclose(together @ together, together, atol=1e-11)
    some = [name for module in robot.modules for name in module.motors[: module.driven]]
    Psi = np.array([hybridyn.motion_map(robot, one, joints=some)[robot.motor_v] for one in q])
    inner = against_each_other(robot, q, 1.0, seed)
    assert np.abs(np.einsum("tmi,tm->ti", Psi, inner)).max() <= 1e-11
    kept = np.einsum("tij,tj->ti", together, hybridyn.idm(robot, q, v, a))
    Y = effort_rows(robot, base_of(kind, seed).standard, q, v, a, together=True)
    np.testing.assert_allclose(Y @ base_of(kind, seed).standard.values, kept, atol=1e-10 * np.abs(kept).max())


@pytest.mark.parametrize(
    ("kind", "seed", "method", "free"),
    [
        (*REDUNDANT[0], "wls", 200),
        *(slow(*one, "wls", 200) for one in REDUNDANT),
        *(slow(*one, "irls", 2000) for one in REDUNDANT if one[0] in QUICK),
    ],
)
def test_claimed_deviations_are_true(kind: str, seed: int, method: str, free: int) -> None:
    """Each motor has noise of its own: errors over their covariance are chi-square.

    Samples beyond those that the parameters take are `free`: the noise is estimated from them.
    """
    robot, base = robot_of(kind, seed), base_of(kind, seed)
    p, rng = base.rank, np.random.default_rng([seed, 7])
    q, v, a = random_motions(robot, free + p // robot.modules[0].driven)
    Y = effort_rows(robot, base.standard, q, v, a, together=True)[:, :, base.columns]
    together, tau = done_together(robot, q), Y @ base.values
    assert together is not None
    spread = 0.02 * tau.std(axis=0) * rng.uniform(0.3, 3.0, len(robot.motors))
    sums = []
    for _ in range(RUNS):
        noise = np.einsum("tij,tj->ti", together, spread * rng.normal(size=tau.shape))
        found = estimate(Y, tau + noise, base.names, method, together=together)
        sums.append(float(np.sum(np.linalg.solve(found.root, found.x - base.values) ** 2)))
    low, high = stats.chi2.ppf([CHANCE, 1 - CHANCE], RUNS * p) / RUNS / p
    assert 0.95 * low <= np.mean(sums) / p <= 1.05 * high  # 5 %: the noise itself is estimated


def test_long_measurements_are_compared_alike() -> None:
    kind, seed = REDUNDANT[1]
    robot, base = robot_of(kind, seed), base_of(kind, seed)
    q, v, a = flight(kind, seed)[1]
    tau = hybridyn.idm(robot, q, v, a) + 3.0 * recorded(kind, seed)[2]
    found = triangular_factor(robot, [(q, v, a, tau)], base=base, weights=np.array([1.0, 2.0, 0.5, 3.0]))
    assert found.rows == len(q) * robot.modules[0].driven
    x = np.linalg.solve(found.R, found.z)
    assert np.abs(x - base.values).max() <= EXACT * np.abs(base.values).max()
