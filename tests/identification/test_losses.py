"""Losses that grow with load: efforts, derivatives, claimed deviations, and what a motion does not tell."""

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest
from scipy import stats

import hybridyn
from hybridyn.effects import GearEfficiency, LoadFriction
from hybridyn.errors import ActuationError, HybridynError, ModelError, TrajectoryError
from hybridyn.identification.base_parameters import base_parameters
from hybridyn.identification.estimators import estimate
from hybridyn.identification.logs import read_log
from hybridyn.identification.loss_fit import LossyRows, _unseen
from hybridyn.identification.losses import sought_losses
from hybridyn.identification.robot_with import with_losses, with_parameters
from hybridyn.identification.rows import LogSource
from hybridyn.identification.sought import linear_model
from tests.identification.logs import Table, case
from tests.support.command_line import call, table_text
from tests.support.comparing import refused
from tests.support.extras import needs
from tests.support.samples import slow

#: Efforts of the linear algebra against those of the model, of the largest.
EXACT = 1e-11
#: Central differences of step 1e-6 against derivatives, of the largest in a column.
DIFFERENCES = 1e-6
#: Rounding of two efforts, of the largest, which the step divides.
ROUNDING = 1e-15
#: Probability with which a test of chance fails although all is right.
CHANCE = 1e-4
NOISE = 0.01
WIDTH = 0.05


def losses_of(robot: hybridyn.HybridRobot) -> tuple[LoadFriction, GearEfficiency]:
    """Return friction of every hinge that the motion determines, and gears of every motor."""
    every = zip(robot.joints, robot.kinds, strict=True)
    kinds = {name: kind for name, kind in every if name not in robot.cut_joints}
    hinges = [name for name, kind in kinds.items() if kind.single and kind.hinge]
    slides = [name for name, kind in kinds.items() if kind.single and kind.slides]
    balls = [name for name, kind in kinds.items() if kind == "spherical"]
    radial = {name: 1e-3 * (1 + i % 3) for i, name in enumerate([*hinges, *balls])}
    load = LoadFriction(radial=radial, normal=dict.fromkeys(slides, 0.05), width=WIDTH)
    gears = {motor: 0.85 + 0.05 * (i % 2) for i, motor in enumerate(robot.motors)}
    return load, GearEfficiency(gears, width=WIDTH)


class Lossy(NamedTuple):
    """A robot with losses, the rows of its motion, its parameters, and their names."""

    robot: hybridyn.HybridRobot
    rows: LossyRows
    true: np.ndarray
    efforts: np.ndarray
    names: tuple[str, ...]


@lru_cache(maxsize=4)
def lossy(name: str, rate: float) -> Lossy:
    """Return a robot whose efforts are those of `idm`, with other base parameters than in its file."""
    one = case(name, False, rate=rate)
    effects = ["model", *losses_of(one.robot)]
    linear, losses = sought_losses(one.robot, effects)
    assert losses is not None
    sought = linear_model(base_parameters(one.robot, effects=linear))
    standard, K = sought.model.standard, sought.model.combination
    moves = sought.followed(one.robot.bodies.size, K @ standard.values)
    x = K @ standard.values * (1 + 0.05 * np.random.default_rng(1).uniform(-1, 1, len(K)))
    heavier = with_parameters(one.robot, standard.values + moves @ (x - K @ standard.values), effects=linear)
    q, v, a = hybridyn.assemble(one.robot, motors=one.motion)
    tau = hybridyn.idm(heavier, q, v, a, effects=effects)
    source = LogSource(one.robot, sought, None, every=2)
    rows = LossyRows.of(source, losses, moves, source.rows(read_log(one.robot, one.log(rates=True, tau=tau))))
    load, gear = losses_of(one.robot)
    c = [*load.radial.values(), *load.normal.values(), *(1 / x - 1 for x in gear.efficiency.values())]
    return Lossy(one.robot, rows, np.array([*x, *c]), tau, (*sought.model.names, *losses.names(one.robot)))


@pytest.mark.parametrize("name", ["five_bar", slow("rps3"), slow("delta"), slow("gough_stewart")])
def test_efforts_are_those_of_the_inverse_model_and_derivatives_those_of_differences(name: str) -> None:
    one = lossy(name, 20.0)
    split = [len(one.rows.rows.start)]
    tau, slope = one.rows.rows.predicted(*np.split(one.true, split))
    assert np.abs(tau - one.efforts).max() <= EXACT * np.abs(one.efforts).max()
    for k, value in enumerate(one.true):
        h = np.eye(len(one.true))[k] * 1e-6 * max(abs(value), 1e-3)
        up, down = (one.rows.rows.predicted(*np.split(one.true + d, split))[0] for d in (h, -h))
        error = (up - down) / (2 * h[k]) - slope[:, :, k]
        rounding = ROUNDING * np.abs(tau).max() / h[k]
        assert np.abs(error).max() <= DIFFERENCES * np.abs(slope[:, :, k]).max() + rounding, one.names[k]


@pytest.mark.parametrize("runs", [5, slow(40)])
def test_claimed_deviations_are_true(runs: int) -> None:
    """Errors over their covariance are chi-square, and those of losses over their deviations, too."""
    one, rng, sums, far = lossy("five_bar", 25.0), np.random.default_rng(3), [], []
    count = len(one.names) - len(one.rows.rows.start)
    of_each = one.rows.data.of_each
    spread = NOISE * one.efforts.std(axis=0) * np.eye(2)
    for _ in range(runs):
        noisy = of_each + spread * rng.normal(size=(len(of_each), 2, 1))
        rows = replace(one.rows, data=replace(one.rows.data, of_each=noisy))
        found = rows.fit(one.names)
        sums.append(float(np.sum(np.linalg.solve(found.root, found.x - one.true) ** 2)))
        far.append(((found.x - one.true) / found.deviation)[-count:])
    n = len(one.names)
    low, high = stats.chi2.ppf([CHANCE, 1 - CHANCE], runs * n) / (runs * n)
    assert low * 0.95 <= np.mean(sums) / n <= high * 1.05  # 5 %: the noise itself is estimated
    low, high = np.sqrt(stats.chi2.ppf([CHANCE / count, 1 - CHANCE / count], runs) / runs)
    each = np.sqrt(np.mean(np.square(far), axis=0))
    assert (low * 0.97 <= each).all(), each
    assert (each <= high * 1.03).all(), each


def noisy(lost: bool, seed: int, *, backwards: bool = False) -> Table:
    """Return a log of the five-bar with or without losses, forwards or backwards in time."""
    one, rng = case("five_bar", False, rate=50.0), np.random.default_rng(seed)
    motion = tuple(x[::-1] * (-1) ** (i * backwards) if backwards else x for i, x in enumerate(one.motion))
    effects = ["model", *(losses_of(one.robot) if lost else ())]
    tau = hybridyn.idm(one.robot, *hybridyn.assemble(one.robot, motors=motion), effects=effects)
    tau = tau + NOISE * tau.std(axis=0) * rng.normal(size=tau.shape)
    return replace_motion(one.log(tau=tau, rates=True), one.robot, motion)


def replace_motion(log: Table, robot: hybridyn.HybridRobot, motion: tuple[np.ndarray, ...]) -> Table:
    for i, motor in enumerate(robot.motors):
        for word, x in zip(("position", "velocity", "acceleration"), motion, strict=True):
            log[f"{motor}/{word}"] = x[:, i]
    return log


@pytest.mark.parametrize("lost", [True, False])
def test_what_the_motion_tells_is_said(lost: bool) -> None:
    """Also where there are no losses: Schwarz's criterion and unseen efforts are against them then."""
    needs("identify")
    robot = case("five_bar", False, rate=50.0).robot
    load, gear = losses_of(robot)
    found = hybridyn.identify(robot, noisy(lost, 4), effects=["model", load, gear], every=1)
    assert found.losses is not None
    assert found.losses.told == lost
    assert found.losses.unseen is not None
    true = [*load.radial.values(), *(1 / x - 1 for x in gear.efficiency.values())]
    error = np.abs(found.losses.values - lost * np.array(true)) / found.losses.deviation
    assert error.max() < 5
    assert (found.losses.hidden >= 1).all()
    says = "the motion tells them from" if lost else "the motion does not tell them from constant friction"
    assert says in repr(found)
    assert ("may be zero, below 3 deviations" in repr(found)) >= (not lost)


def test_the_command_identifies_what_the_robot_s_files_state_and_writes_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    needs("identify")
    robot = case("five_bar", False, rate=50.0).robot
    file, guess = tmp_path / "five_bar.urdf", losses_of(robot)
    hybridyn.convert(with_losses(robot, guess), file)
    for name, backwards in (("first.csv", False), ("second.csv", True)):
        log = noisy(True, 5 + backwards, backwards=backwards)
        (tmp_path / name).write_text(table_text([*log], np.column_stack([*log.values()])))
    out, report = tmp_path / "out.urdf", tmp_path / "report.md"
    words = ["--validate", tmp_path / "second.csv", "-o", out, "--report", report]
    said = call(capsys, "identify", file, tmp_path / "first.csv", *words)
    assert "losses that grow with load: BIC is" in said.out
    assert "the motion tells them from constant friction" in said.out
    assert "| `loss of m1_left_drive` | 0.1" in report.read_text()
    stated = dict(hybridyn.load(out).description.effects)
    assert stated["gear_efficiency"]["efficiency"] == pytest.approx(dict(guess[1].efficiency), abs=0.02)
    assert stated["load_friction"]["radial"] == pytest.approx(dict(guess[0].radial), abs=5e-4)


def test_a_half_whose_friction_does_not_settle_tells_nothing_of_unseen_efforts(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    one, parts = lossy("five_bar", 25.0), list[slice]()
    data, r = one.rows.data, len(one.rows.rows.start)
    plain = estimate(data.Y, data.measured - data.known, one.names[:r])

    def unsettled(_: LossyRows, __: object, part: slice) -> None:
        parts.append(part)
        raise ActuationError("friction does not settle")

    monkeypatch.setattr(LossyRows, "fit", unsettled)
    assert _unseen(one.rows, None, one.names, plain, plain) is None
    assert len(parts) == 1


class Steep(LossyRows):
    """Efforts x + load (exp(5 c) - 1): a step from c = 0 goes far too far, and each step back is short."""

    def predicted(self, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Compute efforts and their derivatives."""
        load, grown = self.data.Y[:, :, 0] * np.linspace(-1, 1, len(self.data.Y))[:, None], np.exp(5 * p[1])
        slope = np.stack([self.data.Y[:, :, 0], load * 5 * grown], axis=2)
        return self.data.Y[:, :, 0] * p[0] + load * (grown - 1), slope


class Uphill(Steep):
    """Derivatives by the loss of the wrong sign: each step leads away, however short."""

    def predicted(self, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Compute efforts and their derivatives."""
        tau, slope = super().predicted(p)
        return tau, slope * [1.0, -1.0]


def steep(kind: type[Steep], true: float, noise: float) -> Steep:
    """Return 50 samples of a mass of 2 and a loss."""
    data: Any = SimpleNamespace(Y=np.ones((50, 1, 1)), known=np.zeros((50, 1)))
    one = kind(data, SimpleNamespace(start=np.zeros(1)), 1)  # type: ignore[arg-type]
    clean = one.predicted(np.array([2.0, true]))[0]
    data.measured = clean + noise * np.random.default_rng(0).normal(size=(50, 1))
    return one


def test_a_search_of_losses_that_only_leads_away_is_refused_and_one_that_ends_is_not() -> None:
    names = ["m:mass", "radial of elbow"]
    refused(
        lambda: steep(Uphill, 0.1, 1e-3).fit(names),
        TrajectoryError,
        "'radial of elbow' still .* and no 0.0002",
    )
    found = steep(Steep, 0.1, 0.0).fit(names)
    assert np.abs(found.x - [2.0, 0.1]).max() < EXACT


@pytest.mark.parametrize("true", [1.0, -1.0])
def test_the_search_of_losses_is_damped_and_names_a_loss_where_it_fails(
    true: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    one = steep(Steep, true, 1e-3)
    found = one.fit(["m:mass", "radial of elbow"])
    assert (np.abs(found.x - [2.0, true]) < 5 * found.deviation).all()
    monkeypatch.setattr("hybridyn.identification.loss_fit.MOST_ROUNDS", 1)
    with pytest.raises(TrajectoryError, match="'radial of elbow' still moves"):
        one.fit(["m:mass", "radial of elbow"])


REDUNDANT = "cannot be identified with redundant motors"
REFUSED: dict[str, tuple[Callable[[hybridyn.HybridRobot], Any], dict[str, Any], str]] = {
    "method": (lambda robot: losses_of(robot)[0], {"method": "irls"}, "by the method 'wls', not 'irls'"),
    "back": (
        lambda robot: GearEfficiency({robot.motors[0]: 0.9}, back={robot.motors[0]: 0.8}), {},
        "efforts tell efficiency and back only up to a factor of all masses",
    ),
    "shared": (
        lambda robot: LoadFriction(axial={robot.motors[0]: 1e-3}), {},
        "redundant closures share loads on which friction depends",
    ),
    "zero": (
        lambda robot: LoadFriction(radial={robot.motors[0]: 1e-3, "m1_left_elbow": 0.0}), {},
        "radial of joint 'm1_left_elbow' is 0, which is not sought: state a first guess above zero",
    ),
    "no friction": (lambda _: LoadFriction(), {}, "load_friction: no coefficient is sought"),
    "no gear": (lambda _: GearEfficiency({}), {}, "gear_efficiency: no coefficient is sought"),
}  # fmt: skip


@pytest.mark.parametrize("why", REFUSED)
def test_what_cannot_be_identified_is_refused(why: str) -> None:
    one = case("five_bar", False, rate=50.0)
    law, words, says = REFUSED[why]
    with pytest.raises(HybridynError, match=says):
        hybridyn.identify(one.robot, one.log(rates=True), effects=["model", law(one.robot)], **words)


def test_currents_and_redundant_motors_are_refused() -> None:
    one = case("five_bar", False, rate=50.0)
    with pytest.raises(ModelError, match="the log has currents, and losses take efforts"):
        hybridyn.identify(
            one.robot, one.log(rates=True, of="current"), effects=["model", losses_of(one.robot)[0]]
        )
    driven = hybridyn.load("five_bar", motors=[*one.robot.motors, "m1_left_elbow"])
    with pytest.raises(ModelError, match=REDUNDANT):
        hybridyn.identify(driven, {}, effects=["model", GearEfficiency({driven.motors[0]: 0.9})])
