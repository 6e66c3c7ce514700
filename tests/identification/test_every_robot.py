"""Identification of every shipped robot and of a random mechanism of every kind."""

import numpy as np
import pytest
from scipy import linalg, stats

import hybridyn
from hybridyn.assembly.assemble import assemble_requests
from hybridyn.assembly.requests import MOTIONS, gather_requests
from hybridyn.effects import CoulombFriction
from hybridyn.identification.base_parameters import random_motions
from hybridyn.identification.estimators import estimate
from hybridyn.identification.inertial import ten_numbers
from hybridyn.identification.regressor import effort_rows
from hybridyn.identification.result import residuals
from hybridyn.identification.robot_with import with_parameters
from hybridyn.structure.robot import joint_position
from tests.identification.robots import (
    SMALL,
    base_of,
    cases,
    described,
    effects_of,
    flight,
    other_values,
    robot_of,
)
from tests.robots.mechanisms import KINDS, random_states

#: Base parameters without noise, of the largest.
EXACT = 1e-9
#: Rounding over the condition of the regressor: above `EXACT` for two mechanisms only, gear_across and
#: branched, of condition 2e7 (worst seen: 3.7e-9, a fifth of this bound).
ROUNDED = 4 * np.finfo(float).eps
#: Few motors: their efforts can be those of random states only for the file's numbers.
FEW = {kind for kind, recipe in KINDS.items() if recipe.motors == "few"}
#: Probability with which a test of chance fails although all is right.
CHANCE = 1e-4
#: Runs with noise of the efforts, and samples of each motor beyond those that the parameters take.
RUNS, FREE = 200, 200
#: Runs with noise of the positions.
NOISY_RUNS = 40
#: With equal legs: otherwise hundreds of parameters.
LARGE = ("lx4", "snake")
#: All joints have motors: positions with noise do not close the loop.
UNCLOSED = ("five_bar_four_motors",)
#: One base parameter makes 1e-8 of the efforts: states far from singular ones do not tell it.
WEAK = ("branched", "gear_across", "six_bar")
#: A motion about home within reach does not tell all base parameters.
UNTOLD = ("branched", "on_leg")


@pytest.mark.parametrize(("kind", "seed"), cases())
def test_base_parameters_come_back(kind: str, seed: int) -> None:
    """From efforts at random states; where motors drive all motions, the bodies differ from the file's."""
    robot, base, effects = robot_of(kind, seed), base_of(kind, seed), effects_of(seed)
    count = 20 + 3 * base.rank // len(robot.motors)
    if seed >= 0 and kind in FEW:
        values, (q, v, a) = base.standard.values, random_states(described(kind, seed), "fixed", seed, count)
    else:
        values, (q, v, a) = other_values(base, seed), random_motions(robot, count)
    tau = hybridyn.idm(with_parameters(robot, values, effects=effects), q, v, a, effects=effects)
    Y = hybridyn.regressor(robot, q, v, a, effects=effects).Y[:, :, base.columns]
    found, wanted = estimate(Y, tau, base.names), base.combination @ values
    bound = max(EXACT, ROUNDED * found.condition)
    assert np.abs(found.x - wanted).max() <= bound * np.abs(wanted).max()


@pytest.mark.parametrize(("kind", "seed"), cases(quick=SMALL))
def test_errors_are_within_the_cramer_rao_bound(kind: str, seed: int) -> None:
    """200 runs, each motor with noise of its own: errors over the bound of the true noise are chi-square.

    Weights are estimated from some 200 samples of each motor, which makes errors larger by less than 5 %; the
    deviation of a motor's noise, and with it those that are claimed, is right to 1 / sqrt(400).
    """
    robot, base = robot_of(kind, seed), base_of(kind, seed, symmetric=kind in LARGE)
    p, rng = base.rank, np.random.default_rng([seed + 1, 7])
    states = random_motions(robot, FREE + p // len(robot.motors))
    Y = effort_rows(robot, base.standard, *states)[:, :, base.columns]
    tau = Y @ base.values
    spread = 0.02 * tau.std(axis=0) * rng.uniform(0.3, 3.0, len(robot.motors))
    R = linalg.qr((Y / spread[:, None]).reshape(-1, p), mode="r")[0][:p]
    sums = []
    for _ in range(RUNS):
        found = estimate(Y, tau + spread * rng.normal(size=tau.shape), base.names)
        sums.append(float(np.sum((R @ (found.x - base.values)) ** 2)))
    low, high = stats.chi2.ppf([CHANCE, 1 - CHANCE], RUNS * p) / RUNS / p
    assert low <= np.mean(sums) / p <= 1.05 * high
    assert stats.kstest(sums, stats.chi2(p).cdf).pvalue > CHANCE
    bound = linalg.norm(linalg.solve_triangular(R, np.eye(p)), axis=1)
    off = stats.norm.ppf(1 - CHANCE / p / 2) / np.sqrt(2 * FREE)
    assert np.abs(found.deviation / bound - 1).max() <= off


@pytest.mark.parametrize(("kind", "seed"), cases(without=(*FEW, *UNCLOSED, *WEAK), quick=SMALL))
def test_instruments_are_unbiased_where_least_squares_is_not(kind: str, seed: int) -> None:
    """Encoders' noise as it is after differentiation within 15 Hz, the loops closed from it.

    Errors are measured as the efforts that they make, one component for each base parameter. Their means over
    the runs are compared with their standard errors.
    """
    robot, base = robot_of(kind, seed), base_of(kind, seed, symmetric=seed < 0)
    p, rng = base.rank, np.random.default_rng([seed + 1, 8])
    count = 40 + 3 * p // len(robot.motors)
    drawn = random_motions(robot, 4 * count)
    Y = effort_rows(robot, base.standard, *drawn)[:, :, base.columns]
    far_from_singular = np.argsort(linalg.norm(Y * base.unit[base.columns], axis=(1, 2)))[:count]
    (q, v, a), Y = (level[far_from_singular] for level in drawn), Y[far_from_singular]
    tau, R = Y @ base.values, linalg.qr(Y.reshape(-1, p), mode="r")[0][:p]
    x = np.stack([joint_position(robot, q, name) for name in robot.motors], axis=1)
    motion = np.stack([x, v[:, robot.motor_v], a[:, robot.motor_v]])
    size = 0.3 * motion[2].std(axis=0) * (2 * np.pi * 15.0) ** np.array([-2.0, -1.0, 0.0])[:, None, None]
    noise = rng.normal(size=(NOISY_RUNS, *motion.shape)).swapaxes(0, 1)
    noisy = motion[:, None] + size[:, None] * noise
    asked = [gather_requests(robot, tuple(noisy[:, :, t]), None) for t in range(count)]
    asked = [one._replace(strict=True, nearest=MOTIONS) for one in asked]  # as `Rows.closed` does
    closed = [assemble_requests(robot, one, start) for one, start in zip(asked, q, strict=True)]
    errors: dict[str, list[np.ndarray]] = {"wls": [], "iv": []}
    for run in range(NOISY_RUNS):
        states = (np.array([one[level][run] for one in closed]) for level in range(3))
        seen = effort_rows(robot, base.standard, *states)[:, :, base.columns]
        measured = tau + 0.01 * tau.std(axis=0) * rng.normal(size=tau.shape)
        for method, all_ in errors.items():
            all_.append(R @ (estimate(seen, measured, base.names, method, Y).x - base.values))
    limit = stats.t.ppf(1 - CHANCE / p / 2, NOISY_RUNS - 1)
    away = {
        method: np.abs(np.mean(e, axis=0) / np.std(e, axis=0, ddof=1)).max() * np.sqrt(NOISY_RUNS)
        for method, e in errors.items()
    }
    assert away["iv"] < limit < away["wls"]


@pytest.mark.parametrize(("kind", "seed"), cases(without=(*FEW, *UNTOLD), quick=(*SMALL, ("rps3", -1))))
def test_wrong_models_are_seen_in_the_residuals(kind: str, seed: int) -> None:
    """Noise alone looks like noise; a friction left out does not, nor a payload in a second motion."""
    robot = robot_of(kind, seed)
    base = hybridyn.base_parameters(robot, symmetric=seed < 0)
    time, (q, v, a) = flight(kind, seed)
    Y, rng = effort_rows(robot, base.standard, q, v, a), np.random.default_rng([seed + 1, 9])
    tau, names = Y @ base.standard.values, base.names
    level = dict(zip(robot.motors, 0.3 * tau.std(axis=0), strict=True))
    rubbed = hybridyn.idm(robot, q, v, a, effects=["default", CoulombFriction(level=level)])
    values, last = base.standard.values.copy(), base.standard.tens[-1]
    mass = 0.1 * sum(body.mass for body in robot.bodies.bodies)
    values[last] += ten_numbers(mass, 0.2 * robot.bodies.size * np.ones(3), np.zeros((3, 3)))
    noise = 0.02 * tau.std(axis=0) * rng.normal(size=(2, *tau.shape))

    def left(first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """Estimate from one motion, and judge what is left of another."""
        found = estimate(Y[:, :, base.columns], first, names)
        return residuals(time, second, second - Y[:, :, base.columns] @ found.x).coloured

    assert not left(tau + noise[0], tau + noise[0]).any()
    assert left(rubbed + noise[0], rubbed + noise[0]).any()
    assert not left(tau + noise[0], tau + noise[1]).any()
    assert left(tau + noise[0], Y @ values + noise[1]).any()
