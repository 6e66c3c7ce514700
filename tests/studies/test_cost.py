"""`hybridyn cost`: Pareto fronts, advice, and the two studies on a small robot."""

import json
import re
import tomllib
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest

import hybridyn
from hybridyn.effects import LoadFriction, choose
from hybridyn.effects.words import FROM_FILES
from hybridyn.scenes.stage import SceneStage, stage
from hybridyn.studies.cost import measured as measuring
from hybridyn.studies.cost import points, reference, runs, scene_effects, spared, variants, ways
from hybridyn.studies.cost import runner as runners
from hybridyn.studies.cost.measured import UNJUDGED, Measured, Trajectory
from hybridyn.studies.cost.points import (
    CostPoint,
    CostStudy,
    Use,
    Worth,
    advice,
    cheapest,
    error_words,
    front,
    timed,
)
from hybridyn.studies.cost.runner import Runner, distance, errors
from hybridyn.studies.cost.runs import study_runs
from hybridyn.studies.cost.scene_effects import effects_fragment, every_effect, needed_effects
from hybridyn.studies.cost.solver_settings import Setting
from hybridyn.studies.cost.variants import QUANTITIES, by_rates, study_models
from hybridyn.tables.signals import WRENCH
from tests import ROOT
from tests.assembly.test_assembly import waves
from tests.robots.robot_texts import door
from tests.support.clocks import Clock
from tests.support.command_line import call, table_text
from tests.support.comparing import refused
from tests.support.extras import needs
from tests.support.files import beginning, save

EXACT = 1e-12
#: Loops closed in C are open by some units in the thirteenth digit.
CLOSED_IN_C = 1e-11


def point(setting: str, error: float, seconds: float, use: Use = "command", how: str = "") -> CostPoint:
    return CostPoint("line", setting, error, seconds, f"--{setting}", use, f"take {setting}", how=how)


POINTS = [
    point("slow", 1e-9, 8.0, use="usual"),
    point("fast", 1e-3, 1.0),
    point("middling", 1e-3, 2.0),
    point("no", 0.0, 0.1, how="the first 5 %"),
    point("drifting", 0.0, 0.2, use="comparison"),
]
STUDY = CostStudy("question", "per sample", "efforts", "reference", 1e-16, POINTS)


def test_no_point_is_better_than_the_front() -> None:
    assert [p.setting for p in front(STUDY.chosen(points.OURS))] == ["fast", "slow"]
    assert front(STUDY.chosen(())) == []
    assert [p.setting for p in front(POINTS[:3], 1e-2)] == ["fast"]
    assert error_words(POINTS[1], replace(STUDY, own_error=1e-2)) == "< 1e-02"


EQUAL = [point("rough", 1e-4, 1.0), point("fine", 1e-8, 1.04)]
OWN = [*POINTS, point("own", 1e-4, 0.5, use="program")]
NARROW = [*POINTS, replace(point("narrow", 1e-4, 0.5), elsewhere=3e-2)]


@pytest.mark.parametrize(
    ("changed", "target", "setting", "said"),
    [
        (
            {},
            1e-2,
            "fast",
            "^For 1 % on efforts, take fast.\nIt takes 1 s per sample, .*1.0e-03.\nWhat is usual: 8 times",
        ),
        ({}, 1e-6, "slow", r"take slow.\n.* an error of 1.0e-09.\nThe fastest of other engines, [^\n]*$"),
        ({}, 1e-12, None, "the least error is 1.0e-09"),
        ({"own_error": 1e-2}, 1e-3, None, "the least error is 1.0e-02"),
        ({"points": EQUAL}, 1e-3, "fine", ""),
        # after a clock that stood still
        (
            {"points": [POINTS[0], point("fast", 1e-3, 0.0)]},
            1e-2,
            "fast",
            "^For 1 % on efforts, take fast.",
        ),
        (
            {"points": OWN},
            1e-2,
            "fast",
            r"In a program of your own, take own: 0.5 times.*\n.* engines, line, drifting: 0.2 times",
        ),
        (
            {"points": NARROW},
            1e-3,
            "narrow",
            "'line, narrow' does not carry over to the same path at 0.7 .*, where its error is 3.0e-02",
        ),
    ],
)
def test_advice_names_the_cheapest_way_and_what_it_saves(
    changed: dict[str, Any], target: float, setting: str | None, said: str
) -> None:
    study = replace(STUDY, **changed)
    found = cheapest(study, target)
    assert (found and found.setting) == setting
    assert re.search(said, "\n".join(advice(study, target)))


@pytest.mark.parametrize(
    ("takes", "calls", "least"),
    [([0.2, 0.1, 0.3, 0.1], 3, 0.1), ([1.5], 1, 1.5), ([0.001] * 60, 50, 0.001)],
)
def test_a_time_is_the_least_of_several(
    takes: list[float], calls: int, least: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock, left = Clock(), list(takes)
    monkeypatch.setattr(points, "clock", clock)

    def call() -> None:
        """Take the next of the times."""
        clock.now += left.pop(0)

    assert timed(call) == [pytest.approx(least, abs=EXACT)]
    assert len(takes) - len(left) == calls


def test_distances_are_joint_displacements() -> None:
    robot = hybridyn.load("five_bar")
    q = robot.home.copy()
    q[0] += 0.25
    assert distance(robot, robot.home, q) == pytest.approx(0.25, abs=EXACT)


def motion(robot: hybridyn.HybridRobot, rows: int = 130) -> Trajectory:
    time = np.linspace(0, 1, rows)
    return Trajectory(*hybridyn.assemble(robot, motors=waves(robot, time, 0.2)), time)


@pytest.mark.slow
def test_the_efforts_of_a_motion_are_measured_stage_by_stage() -> None:
    needs("compiled")
    robot = hybridyn.load("five_bar")
    some, on = motion(robot), choose(robot, "model")
    seen: list[CostPoint | Worth] = []
    study = study_models(robot, some, on, seen.append)
    assert [x for x in seen if isinstance(x, CostPoint)] == study.points
    assert [x for x in seen if isinstance(x, Worth)] == study.worth
    assert study.remarks == []
    assert study.done == 1.0
    found = {(p.line, p.setting): p for p in study.points}
    assert found["compiled", "every effect"].error < EXACT
    assert 1e-9 < found["compiled, float32", "every effect"].error < 1e-3
    assert [p.setting for p in study.points if p.one_call] == ["every effect"]
    # The error without an effect is the effort that the effect adds, computed by another call.
    q, v, a = some.q, some.v, some.a
    whole = hybridyn.idm(robot, q, v, a, effects="model")
    less = hybridyn.idm(robot, q, v, a, effects=[x for x in on.names if x != "velocity"])
    off = (np.abs(less - whole).max(axis=0) / np.abs(whole).max(axis=0)).max()
    worth = {one.effect: one for one in study.worth}
    assert worth["velocity"].error == pytest.approx(off, rel=1e-9)
    assert worth["leg_inertia"].share > worth["velocity"].share > 0
    spline, differences = (
        found["rates of the trajectory", x].error for x in ("quintic spline", "central differences")
    )
    assert spline < 1e-6 < differences


@pytest.mark.slow
def test_friction_matters_more_when_the_same_path_is_slower() -> None:
    robot = hybridyn.load("five_bar")
    on = choose(robot, ["gravity", "inertia", "leg_inertia", "coulomb_friction"])
    run = Measured(CostStudy("", ""), robot, motion(robot, 40), on, "idm")
    left = on.only(["gravity", "inertia", "leg_inertia"])
    here, elsewhere = run.errors(partial(hybridyn.idm, robot, effects=left))
    target = float(np.sqrt(here * elsewhere))
    study = study_models(robot, motion(robot, 40), on, target=target)
    (without,) = (p for p in study.points if p.setting == "without 'coulomb friction'")
    assert without.error == pytest.approx(here, rel=1e-9)
    assert without.error < target < without.elsewhere
    assert any("does not carry over" in x for x in advice(replace(study, points=[without]), target))


def test_motors_that_need_no_effort_are_judged_by_the_others() -> None:
    exact, noise = np.array([[1e-16, 4.0], [0.0, -2.0]]), np.array([[-1e-16, 1e-9], [1e-16, 0.0]])
    assert reference.off(exact + noise, exact, efforts=True) == pytest.approx(1e-9 / 4.0, rel=1e-6)
    assert reference.off(exact + np.array([1.0, 0.0]), exact) == pytest.approx(1.0 / 4.0)


def test_without_a_compiler_nothing_is_claimed(monkeypatch: pytest.MonkeyPatch) -> None:
    def absent(*_: object, **__: object) -> None:
        """Have no compiler."""
        raise hybridyn.CompileError("no compiler")

    for place in (ways, measuring, variants):
        monkeypatch.setattr(place, "compile", absent)
    monkeypatch.setattr(measuring, "exact", absent)
    monkeypatch.setattr(points, "clock", Clock(tick=1e-3))
    robot = hybridyn.load("five_bar")
    study = study_models(robot, motion(robot, 5), choose(robot, "model"))
    assert study.own_error == UNJUDGED
    assert "no C code: no compiler" in study.reference
    assert "compiled: no compiler" in study.remarks
    usual = next(p for p in study.points if p.use == "usual")
    assert error_words(usual, study) == "< 1e-09"
    assert advice(study, 1e-12)[0].startswith("For 1e-12 on motor efforts no setting that was tried suffices")


@pytest.mark.slow
@pytest.mark.parametrize("quantity", QUANTITIES)
def test_every_quantity_has_its_front_and_engines_theirs(quantity: str) -> None:
    needs("compiled")
    needs("bench")
    robot = hybridyn.load("five_bar")
    engines = ("pinocchio", "mujoco")
    study = study_models(robot, motion(robot), choose(robot, None), quantity=quantity, engines=engines)
    by_line = points.by_line(study.points)
    assert study.own_error < 1e-7
    least = max(CLOSED_IN_C, 2 * study.own_error)
    assert min(p.error for p in by_line["compiled"]) < least
    assert min(p.elsewhere for p in by_line["compiled"]) < least
    best = cheapest(study, 1e-6)
    assert best is not None
    assert best.use != "comparison"
    assert {p.use for line in by_line for p in by_line[line] if line.startswith(("pin.", "MuJoCo"))} <= {
        "comparison"
    }
    lowest = {line: min(p.error for p in own) for line, own in by_line.items()}
    if quantity == "ddm":
        assert max(lowest["pin.lcaba"], lowest["pin.constraintDynamics"]) < CLOSED_IN_C
        stiff = {p.setting: p.error for p in by_line["MuJoCo"]}
        soft = [stiff[f"impedance {x:g}, iterations 100"] for x in (0.9, 0.99, 0.999, 0.9999)]
        assert soft == sorted(soft, reverse=True)  # never rigid
        assert soft[-1] < 1e-2
    elif quantity == "idm":
        assert lowest["pin.rnea + projection, dense"] < EXACT < lowest["pin.rnea, loops open"]
        assert "mujoco: has none of motor efforts of robots with loops" in study.remarks
    elif quantity.endswith("jacobian"):
        differences = {p.setting: p.error for p in by_line["central differences"]}
        assert 50 < differences["step 0.001"] / differences["step 0.0001"] < 200  # second order


def test_an_engine_that_is_not_swept_is_refused() -> None:
    robot = hybridyn.load("five_bar")
    rest = Trajectory(robot.home[None], np.zeros((1, 4)), np.zeros((1, 4)), None)
    said = r"there is no engine 'mujco' \(did you mean 'mujoco'"
    refused(
        lambda: study_models(robot, rest, choose(robot, None), engines=["mujco"]), hybridyn.ModelError, said
    )


def test_a_robot_without_motors_has_no_efforts() -> None:
    robot = hybridyn.load("five_bar", motors=[])
    rest = Trajectory(robot.home[None], np.zeros((1, 4)), np.zeros((1, 4)), None)
    refused(
        lambda: study_models(robot, rest, choose(robot, None)),
        hybridyn.HybridynError,
        "has no motors, and so",
    )


def test_rates_are_fitted_to_rows_at_known_times() -> None:
    robot = hybridyn.load("five_bar")
    some = motion(robot)
    run = Measured(CostStudy("", "per sample"), robot, some._replace(time=None), choose(robot, None), "idm")
    refused(lambda: [*by_rates(run)], hybridyn.HybridynError, "needs times, 120 rows")


SWING = ROOT / "models/five_bar/swing.toml"
SHORT = 0.05  # s of the swing


def end_of(ready: SceneStage, **options: Any) -> np.ndarray:
    """Return the last posture of the beginning of a scene."""
    options = {"method": "dopri5", "rtol": 1e-12, "atol": 1e-14, "effects": ready.effects} | options
    return hybridyn.simulate(ready.robot, ready.q0, ready.v0, (0.0, SHORT), **options).q[-1]


@pytest.fixture(scope="module")
def swing() -> CostStudy:
    """Measure the beginning of the swing once for all tests that use it."""
    needs("compiled")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(runs, "FACTORS", (8.0, 4.0))
        patch.setattr(runs, "TOLERANCES", (1e-3, 1e-7))
        patch.setattr(runners, "LADDER", (1e-10, 1e-12))
        patch.setattr(runners, "clock", Clock(tick=1e-6))  # times are numbers of steps
        return study_runs(stage(SWING), SHORT)


@pytest.fixture
def measured(swing: CostStudy, monkeypatch: pytest.MonkeyPatch) -> None:
    """Replace the measurement of the command by the one of `swing`."""

    def filled(*given: object) -> None:
        """Fill in the study that the command gives."""
        vars(given[4]).update(vars(swing))

    monkeypatch.setattr(runs, "study_runs", filled)


@pytest.mark.parametrize("seed", range(20))
def test_an_error_between_two_outputs_shows_in_the_path(seed: int) -> None:
    """An error of a hundredth of a run that is gone at its end."""
    robot, rng = hybridyn.load("five_bar"), np.random.default_rng(seed)
    t, rest = runners.OUTPUTS, np.zeros(len(runners.OUTPUTS))
    exact = SimpleNamespace(status="finished", q=np.tile(robot.home, (len(t), 1)), residual=rest)
    exact.kinetic = exact.potential = rest
    bump = np.exp(-(((t - rng.uniform(0.03, 0.97)) / 0.005) ** 2))
    found = SimpleNamespace(**vars(exact) | {"q": exact.q + 1e-3 * bump[:, None]})
    away = errors(robot, found, exact)
    assert away["path"] == pytest.approx(1e-3, rel=0.25)
    assert away["error"] < 1e-9
    stopped = SimpleNamespace(**vars(found) | {"status": "interrupted", "q": found.q[: rng.integers(201)]})
    assert errors(robot, stopped, exact) == {"error": np.inf}
    assert errors(robot, exact, stopped) == {"error": np.inf}


@pytest.mark.slow
def test_the_path_of_a_setting_is_its_largest_error_at_any_time(swing: CostStudy) -> None:
    ready = stage(SWING)
    times = np.linspace(0.0, SHORT, 1001)
    both = [
        hybridyn.simulate(
            ready.robot, ready.q0, ready.v0, (0.0, SHORT), output_times=times, method="dopri5", rtol=rtol,
            atol=rtol * 1e-2, compiled=hybridyn.compile(ready.robot, ready.effects, wait=True),
        ).q
        for rtol in (1e-3, 1e-12)
    ]  # fmt: skip
    away = max(distance(ready.robot, *pair) for pair in zip(*both, strict=True))
    point = next(p for p in swing.points if p.setting == "rtol 0.001")
    assert point.path == pytest.approx(away, rel=0.02)


@pytest.mark.slow
def test_methods_of_a_scene_have_their_orders(swing: CostStudy) -> None:
    by_line = {
        line: [p.error for p in own] for line, own in points.by_line(swing.chosen(points.OURS)).items()
    }
    assert 8 < by_line["rk4"][0] / by_line["rk4"][1] < 40  # fourth order: 16, when steps are halved
    assert 3 < by_line["conserving"][0] / by_line["conserving"][1] < 5  # second order: 4
    dopri5 = {p.setting: p.error for p in swing.points if p.line == "dopri5"}
    assert dopri5["rtol 0.001"] > dopri5["rtol 1e-07"] > dopri5["rtol 1e-10"]
    assert next(p for p in swing.points if p.use == "usual").error < 1e-4
    assert {one.effect for one in swing.worth if one.computed} == {"leg_inertia", "velocity"}


@pytest.mark.slow
def test_what_an_effect_of_a_scene_changes_is_the_way_between_two_runs(swing: CostStudy) -> None:
    ready = stage(SWING)
    for names, effect in (
        (["default", "viscous_friction"], "viscous_friction"),
        (["gravity", "inertia", "leg_inertia"], "velocity"),
    ):
        ends = [end_of(ready, effects=on) for on in (None, names)]
        found = next(one.error for one in swing.worth if one.effect == effect)
        assert found == pytest.approx(distance(ready.robot, *ends), rel=1e-3)


@pytest.mark.slow
def test_a_scene_on_the_command_line(
    tmp_path: Path, measured: None, capsys: pytest.CaptureFixture[str]
) -> None:
    needs("view")
    table, figure = tmp_path / "cost.json", tmp_path / "cost.svg"
    out = call(capsys, "cost", SWING, "--until", SHORT, "-o", table, "--plot", figure)
    assert out.out.startswith("For 0.1 % on the last posture, take ")
    assert "its own error" in out.out
    assert len(out.out.splitlines()) < 40
    rows = json.loads(table.read_text())
    assert {row["setting"] for row in rows if row["line"] == "effect"} >= {"velocity", "leg_inertia"}
    assert figure.read_text().startswith("<?xml")


@pytest.mark.slow
def test_ctrl_c_keeps_what_was_measured(
    swing: CostStudy, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(*given: object) -> None:
        """Measure two settings."""
        study = given[4]
        study.points += swing.points[:2]
        raise KeyboardInterrupt

    monkeypatch.setattr(runs, "study_runs", interrupted)
    out = call(capsys, "cost", SWING, "--until", SHORT, "--all", status=130)
    assert all(p.setting in out.out for p in swing.points[:2])
    assert "stopped by Ctrl-C: what follows was not measured" in out.out


@pytest.mark.slow
@pytest.mark.parametrize("target", [1e-3, 1e-8])
def test_the_lines_of_a_target_run_and_reach_it(
    target: float, tmp_path: Path, measured: None, capsys: pytest.CaptureFixture[str]
) -> None:
    out = call(capsys, "cost", SWING, "--until", SHORT, "--target", target)
    assert (out.status, out.err) == (0, "")
    pasted = tomllib.loads(out.out)["solver"]
    ready = stage(SWING)
    assert distance(ready.robot, end_of(ready, **pasted), end_of(ready)) <= target
    text = SWING.read_text().replace("../../", f"{ROOT}/").replace("duration = 2.0", f"duration = {SHORT}")
    before, rest = text.split("[solver]")
    mine = save(tmp_path, before + out.out + "\n[output]" + rest.split("[output]")[1], "mine.toml")
    call(capsys, "simulate", mine, "-o", tmp_path / "run.csv")


@pytest.mark.slow
def test_a_target_out_of_reach_prints_nothing_to_paste(
    measured: None, capsys: pytest.CaptureFixture[str]
) -> None:
    said = "no setting that was tried suffices: the least error is"
    call(capsys, "cost", SWING, "--until", SHORT, "--target", "1e-30", status=1, says=said)


def test_effects_that_a_scene_needs() -> None:
    ready = stage(ROOT / "models/lx4/sag.toml")
    study = CostStudy("", "per run")
    study.worth = [
        Worth("leg_inertia", 1e-2, 0.4, computed=True),
        Worth("velocity", 1e-5, 0.1, computed=True),
        Worth("viscous_friction", 9.95e-4, 0.1, computed=True),
        Worth("coulomb_friction", 2e-3, 0.01, computed=False),
        Worth("rotor_inertia", 1e-4, 0.01, computed=False),
    ]
    every = choose(ready.robot, "model")
    every = replace(every, names=(*every.names, "payload"))
    needed = needed_effects(study, ready, every, 1e-3)
    assert needed[:3] == ["gravity", "inertia", "leg_inertia"]
    assert {*needed} - {*needed[:3]} == {"viscous_friction", "coulomb_friction", "payload"}
    lines = tomllib.loads(effects_fragment(ready.source, needed))
    assert lines["effects"]["use"] == [name for name in needed if name != "payload"]
    # together they change more than the target: the payload stays in a table of its own
    assert needed_effects(study, ready, every, 1e-7) != []


@pytest.mark.parametrize(("here", "there", "kept"), [(5e-4, 5e-4, 3), (2e-3, 5e-4, 4), (5e-4, 2e-3, 3)])
def test_effects_that_miss_the_target_over_the_whole_scene_are_not_advised(
    monkeypatch: pytest.MonkeyPatch, here: float, there: float, kept: int
) -> None:
    """The changes of single effects need not add up: their set is run, and once more from the end."""
    ready = stage(SWING)
    every = ready.effects.only(["gravity", "inertia", "leg_inertia", "velocity"])
    end = SimpleNamespace(state=SimpleNamespace(q=ready.q0, v=ready.v0))
    runner = SimpleNamespace(ready=ready, compiled=True, whole=lambda *_: end, start=None)
    monkeypatch.setattr(
        scene_effects, "errors", lambda *_: {"error": here if runner.start is None else there}
    )
    some = ["gravity", "inertia", "leg_inertia"]
    needed, said = scene_effects.checked_together(runner, every, some, 1e-3, 1.0)
    assert ("do not carry over to a motion" in said[-1]) == (there > 1e-3)
    assert len(needed) == kept
    assert said[0] == f"without 'velocity', the end is {here:.1e} from that with every effect that is stated"


def test_effects_that_were_not_run_to_the_end_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """What changes little over the beginning of a scene may change everything at its end."""
    monkeypatch.setattr(runners, "clock", Clock(tick=1.0))
    scene = Runner(stage(SWING), 2.0)
    scene.compiled = False
    said = "a run came to .* s of 2 s in 4 s of computing: --seconds gives more time"
    every = choose(scene.ready.robot, "model")
    refused(lambda: [*scene_effects.worth_at_end(scene, every, 4.0)], hybridyn.HybridynError, said)
    needed, words = scene_effects.checked_together(scene, every, ["gravity", "inertia"], 1e-3, 4.0)
    assert needed == ["gravity", "inertia"]
    assert re.fullmatch(f"not compared with every effect that is stated: {said}", words[0])


def test_effects_that_act_on_nothing_have_no_line(tmp_path: Path) -> None:
    """Files that state a rotor, a friction or none: of those that are not there, no word."""
    limit = 'velocity="20" effort="50"/>'
    for stated in ("", '<dynamics damping="0.1"/>'):
        robot = hybridyn.load(save(tmp_path, door(1).replace(limit, limit + stated), "door.urdf"))
        some, names = motion(robot, 4), {"viscous_friction"} if "damping" in stated else set()
        on = choose(robot, "model")
        study = CostStudy("", "per sample")

        def off(solve: Any, at: Trajectory = some) -> tuple[float, float]:
            """Return a change that no effect causes by itself."""
            return float(np.abs(solve(*at[:3])).max() < 0.0), 0.0

        run = SimpleNamespace(motions=[()], quantity="idm", robot=robot, effects=on, errors=off, study=study)
        found = {one.effect for one in spared.by_effects(run, -1.0) if isinstance(one, Worth)}
        assert found & {*FROM_FILES} == names
        scene = SimpleNamespace(robot=robot, effects=on)
        assert {*every_effect(scene).names} & {*FROM_FILES} == names


@pytest.mark.slow
def test_accelerations_along_a_scene_are_compared_with_those_of_engines(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Rigid bodies under the scene's efforts: those of the friction that the scene has are not theirs."""
    needs("compiled")
    needs("bench")
    out = call(capsys, "cost", SWING, "--until", SHORT, "--with", "pinocchio,mujoco", "--all").out
    assert out.startswith("For 0.1 % on accelerations, keep every effect and compute in C.")
    assert {"pin.lcaba", "MuJoCo"} <= {
        line[1:].split("  ")[1].strip() for line in out.splitlines() if line[:1] == "-"
    }


@pytest.mark.slow
def test_a_scene_that_cannot_be_compiled_is_measured_by_the_general_path(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A wrench over time stays out of compiled models, and out of the operations of single effects."""
    monkeypatch.setattr(runners, "clock", Clock(tick=2e-3))  # s a step
    monkeypatch.setattr(runs, "FACTORS", (8.0, 4.0))
    monkeypatch.setattr(runs, "TOLERANCES", (1e-3, 1e-7))
    monkeypatch.setattr(runners, "LADDER", (1e-8, 1e-10))
    study = study_runs(stage(ROOT / "models/tanev/push.toml"), 1e-3, seconds=12.0)
    assert study.remarks[0].startswith("no compiled models: the effect 'wrench' cannot be compiled")
    assert all("--engine general" in p.fragment for p in study.points)
    assert cheapest(study, 1e-3) is not None
    assert {"leg_inertia", "velocity"} <= {one.effect for one in study.worth if one.computed}


@pytest.mark.slow
def test_an_event_ends_every_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runners, "clock", Clock(tick=1e-4))  # s a step
    text = SWING.read_text().replace("../../", f"{ROOT}/")
    stop = '\n[[events]]\njoint = "m1_left_drive"\nat = 0.49\ndirection = "both"\nstop = true\n'
    study = study_runs(stage(save(tmp_path, text + stop, "event.toml")), 2.0, seconds=3.0)
    assert "where an event ends it" in study.question
    assert next(p for p in study.points if p.use == "usual").error < 1e-3


def test_no_beginning_is_proposed_where_no_run_begins(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runners, "simulate", Mock(side_effect=hybridyn.HybridynError("q0 is singular")))
    scene = Runner(stage(SWING), 2.0)
    scene.compiled = False
    said = "no reference: q0 is singular. Give more time"
    refused(lambda: scene.find_reference(1.0), hybridyn.HybridynError, said)


@pytest.mark.slow
def test_the_beginning_that_is_proposed_has_a_reference(monkeypatch: pytest.MonkeyPatch) -> None:
    """The runs of a scene of 20 s end at 0.3 s, where a platform is singular, say."""
    needs("compiled")
    monkeypatch.setattr(runners, "LADDER", (1e-8, 1e-10))
    end = 0.3

    def simulated(robot: Any, q: Any, v: Any, times: Any, *, output_times: Any, **words: Any) -> Any:
        last = min(end, times[1])
        there = [*output_times[output_times < last], last]
        found = hybridyn.simulate(robot, q, v, (0.0, last), output_times=there, **words)
        return replace(found, status="singular") if times[1] > end else found

    monkeypatch.setattr(runners, "simulate", simulated)
    said = str(
        refused(lambda: Runner(stage(SWING), 20.0).find_reference(1e9), hybridyn.HybridynError, "--until")
    )
    until = float(said.partition("--until ")[2].partition(")")[0])
    assert until == end / 2
    scene = Runner(stage(SWING), until)
    assert scene.find_reference(1e9).status == "finished"
    assert scene.own_error < 1e-6


def test_a_run_that_takes_too_long_is_stopped_and_its_time_extrapolated(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(runners, "clock", Clock(tick=1.0))
    scene = Runner(stage(SWING), 2.0)
    options = scene.ready.source.scene.solver.model_dump(exclude_none=True)
    usual = Setting(options, "", "usual", compiled=False)
    early, _ = scene.run(usual, 3.5)
    assert (early.status, 0 < early.state.t < 2.0) == ("interrupted", True)
    scene.exact = early
    point = runs._point(scene, usual, early, 3.5, 0.0)
    assert (point.error, point.seconds) == (np.inf, pytest.approx(3.5 * 2.0 / early.state.t))
    assert re.fullmatch(r"the first \S+ % of the scene.*, time extrapolated", point.how)
    assert error_words(point, STUDY) == "not known"
    stopped, _ = scene.run(usual, 13.5)
    assert stopped.status == "interrupted"
    assert 0 < stopped.state.t < 2.0
    scene.duration = float(stopped.t[-1])
    again, _ = scene.run(usual, np.inf)
    assert distance(scene.ready.robot, stopped.q[-1], again.q[-1]) < 1e-9


@pytest.mark.slow
def test_a_scene_that_takes_too_long_is_measured_at_its_beginning(monkeypatch: pytest.MonkeyPatch) -> None:
    needs("compiled")
    monkeypatch.setattr(runners, "clock", Clock(tick=0.1))  # s a step
    study = study_runs(stage(SWING), 2.0)
    assert any("s are measured: --seconds gives more time" in said for said in study.remarks)
    assert advice(study, 1e-3)[0].startswith("For 0.1 % on the last posture, take")


@pytest.mark.slow
def test_one_row_is_enough(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    needs("compiled")
    out = call(capsys, "cost", "five_bar", beginning(tmp_path, "five_bar", 1), "--all")
    assert "(usual)" in out.out
    assert "120 rows or more" in out.out


@pytest.mark.slow
def test_what_is_closed_in_python_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    """A full pose states more than the three freedoms of tanev's platform; C hands such postures over."""
    needs("compiled")
    said = call(capsys, "cost", "tanev", "tanev/traj.csv", "--seconds", "5")
    assert re.search(r"closing: \d+ of \d+ samples are closed in Python", said.out)


def test_a_table_with_wrenches_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Most settings cannot compute a load on a link: without the word, the errors are of another task."""
    table = tmp_path / "held.csv"
    header = ["time", "m1_left_drive/position", "m1_right_drive/position"]
    header += [f"m1_tool/wrench/{component}" for component in WRENCH]
    table.write_text(table_text(header, np.linspace([0.0] * 9, [1.0, 0.1, 0.2, 0, 0, -100, 0, 0, 0], 9)))
    call(
        capsys,
        "cost",
        "five_bar",
        table,
        status=1,
        says="held.csv: has wrenches ('m1_tool'), which 'cost' does not measure",
    )


def test_losses_that_grow_with_load_are_ranked(monkeypatch: pytest.MonkeyPatch) -> None:
    """Their error is what they change of efforts; what they take is timed, since nothing is counted."""
    monkeypatch.setattr(points, "LONG", 0.0)
    robot = hybridyn.load("five_bar")
    motors = {name: (np.linspace(0, 0.2, 6), np.full(6, 1.0), np.zeros(6)) for name in robot.motors}
    state = hybridyn.assemble(robot, motors=motors)
    friction = LoadFriction(radial={"m1_left_drive": 0.01, "m1_right_elbow": 0.02})
    on = choose(robot, ["default", friction])
    run = Measured(CostStudy("", "per sample"), robot, Trajectory(*state, None), on, "idm")
    worth = {one.effect: one for one in spared.by_effects(run, EXACT) if isinstance(one, Worth)}
    exact, bare = (hybridyn.idm(robot, *state, effects=effects) for effects in (on, "default"))
    change = (np.abs(exact - bare).max(axis=0) / np.abs(exact).max(axis=0)).max()
    assert abs(worth["load_friction"].error - change) < EXACT
    assert worth["load_friction"].error > 1e-3
    assert {"gravity", "load_friction"} - {*worth} == {"gravity"}
