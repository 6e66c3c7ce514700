"""`hybridyn cost`: Pareto fronts, advice, and the two studies on a small robot."""

import csv
import tomllib
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.effects import choose
from hybridyn.scenes.stage import stage
from hybridyn.structure.building import build_robot
from hybridyn.structure.robot import HybridRobot
from hybridyn.studies.cost import loops, models, points, runs, settings
from hybridyn.studies.cost.fragments import effects_fragment
from hybridyn.studies.cost.loops import Newton, by_closing
from hybridyn.studies.cost.models import UNJUDGED, Trajectory, study_models
from hybridyn.studies.cost.points import Point, Study, Use, advice, cheapest, error_words, front, timed
from hybridyn.studies.cost.rates import by_rates
from hybridyn.studies.cost.runs import Runner, TooLongError, distance, study_runs, typical_step
from hybridyn.studies.cost.settings import of_integration
from hybridyn.tables.rates import derivatives
from hybridyn.tables.signals import WRENCH
from tests import ROOT
from tests.clocks import Clock
from tests.command_line import call, table_text
from tests.comparing import refused
from tests.files import save
from tests.shipped import shipped

EXACT = 1e-12


def point(setting: str, error: float, seconds: float, failure: str = "", use: Use = "command") -> Point:
    return Point("line", setting, error, seconds, f"--{setting}", failure, use, f"take {setting}")


POINTS = [
    point("slow", 1e-9, 8.0, use="usual"),
    point("fast", 1e-3, 1.0),
    point("middling", 1e-3, 2.0),
    point("no", 0.0, 0.1, "broken"),
    point("drifting", 0.0, 0.2, use="comparison"),
]
STUDY = Study("question", POINTS, "reference", 1e-16, "per sample", "efforts", "the slow way")


def test_no_point_is_better_than_the_front() -> None:
    assert [p.setting for p in front(POINTS)] == ["fast", "slow"]
    assert cheapest(STUDY, 1e-2) == POINTS[1]
    assert cheapest(STUDY, 1e-6) == POINTS[0]
    assert cheapest(STUDY, 1e-12) is None


def test_nothing_is_known_better_than_the_reference() -> None:
    blurred = STUDY._replace(own_error=1e-2)
    assert [p.setting for p in front(POINTS, 1e-2)] == ["fast"]
    assert cheapest(blurred, 1e-3) is None
    assert "the least error is 1.0e-02" in advice(blurred, 1e-3)
    assert error_words(POINTS[1], blurred) == "< 1e-02"


def test_equal_times_go_to_the_more_accurate() -> None:
    study = STUDY._replace(points=[point("rough", 1e-4, 1.0), point("fine", 1e-8, 1.04)])
    assert cheapest(study, 1e-3) == study.points[1]


def test_advice_after_a_clock_that_stood_still() -> None:
    study = STUDY._replace(points=[POINTS[0], point("fast", 1e-3, 0.0)])
    assert advice(study, 1e-2).startswith("For 1 % on efforts, take fast: no faster than the slow way")


def test_advice_names_the_way_and_what_it_saves() -> None:
    assert advice(STUDY, 1e-2).startswith("For 1 % on efforts, take fast: 8 times as fast as the slow way")
    assert "take slow (error 1.0e-09): nothing cheaper suffices" in advice(STUDY, 1e-6)
    assert "the least error is 1.0e-09" in advice(STUDY, 1e-12)
    own = point("own", 1e-4, 0.5, use="program")
    said = advice(STUDY._replace(points=[*POINTS, own]), 1e-2)
    assert said.endswith("; in a program of your own, take own: 16 times (error 1.0e-04).")
    assert cheapest(STUDY._replace(points=[*POINTS, own]), 1e-2) == POINTS[1]


@pytest.mark.parametrize(
    ("takes", "calls", "least"),
    [([0.5, 0.3, 0.2, 0.4, 0.3], 5, 0.2), ([1.5], 1, 1.5), ([0.5, 2.0, 1, 1, 1], 5, 0.5)],
)
def test_a_time_is_the_least_of_several(
    takes: list[float], calls: int, least: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock, left = Clock(), list(takes)
    monkeypatch.setattr(points, "clock", clock)

    def call() -> int:
        """Take the next of the times."""
        clock.now += left.pop(0)
        return len(takes) - len(left)

    result, seconds = timed(call)
    assert result == calls
    assert seconds == pytest.approx(least, abs=EXACT)


def test_distances_are_joint_displacements() -> None:
    robot = build_robot(shipped("five_bar"))
    q = robot.home.copy()
    q[0] += 0.25
    assert distance(robot, robot.home, q) == pytest.approx(0.25, abs=EXACT)


def motion(robot: HybridRobot, rows: int = 130) -> Trajectory:
    time = np.linspace(0, 1, rows)
    motors = {}
    for i, motor in enumerate(robot.motors):
        home, wave = robot.home[robot.q_slices[robot.joint_index[motor]].start], 2 * time + i
        motors[motor] = (home + 0.2 * np.sin(wave), 0.4 * np.cos(wave), -0.8 * np.sin(wave))
    return Trajectory(*hybridyn.assemble(robot, motors=motors), time)


@pytest.mark.slow
def test_models_of_a_small_robot() -> None:
    robot = hybridyn.load("five_bar")
    some = motion(robot)
    study = study_models(robot, some, choose(robot, "model"), lambda what: None)
    found = {(p.line, p.setting): p for p in study.points}
    assert not [p for p in study.points if p.failure]
    assert 0 < study.own_error < 1e-13
    usual = next(p for p in study.points if p.use == "usual")
    every = "+ coulomb friction: every effect"
    assert usual.error < EXACT
    assert found["C in float64", every].error < EXACT
    assert 1e-9 < found["C in float32", every].error < 1e-3
    closing = [p for p in study.points if p.line.startswith("loops")]
    assert closing[0].setting == "1e-03, C in float32"
    assert closing[-1].setting == "1e-13, C in float64"
    assert {p.use for p in closing} == {"program"}
    assert closing[0].error > 1e-6 > 1e-10 > closing[-1].error
    assert all(a.own <= b.own for a, b in pairwise(closing))  # a tighter tolerance never takes fewer steps
    # The error without an effect is the effort that the effect adds, computed by another call.
    q, v, a = some.q, some.v, some.a
    whole = hybridyn.idm(robot, q, v, a, effects="model")
    for line, setting, kept in (
        ("effects", "+ velocity", ["default"]),
        ("C in float64", "all but velocity", [x for x in choose(robot, "model").names if x != "velocity"]),
    ):
        less = hybridyn.idm(robot, q, v, a, effects=kept)
        off = np.abs(less - whole).max(axis=0) / np.abs(whole).max(axis=0)
        assert found[line, setting].error == pytest.approx(off.max(), rel=1e-9)
    spline, differences = (
        found["rates of the trajectory", x].error for x in ("quintic spline", "central differences")
    )
    assert spline < 1e-6 < differences
    # Two effects are dropped together where they matter least.
    assert any(setting.startswith("all but") and "," in setting for _, setting in found)


@pytest.mark.slow
def test_loops_left_open_are_for_public_calls_too() -> None:
    robot = hybridyn.load("five_bar")
    some, on = motion(robot, 40), choose(robot, "model")
    whole = hybridyn.idm(robot, some.q, some.v, some.a, effects=on)
    points = {
        p.setting: p
        for p in by_closing(robot, some.q, some.v, some.a, on, lambda tau: float(abs(tau - whole).max()))
    }
    open_by = some.q.copy()
    for module in robot.modules:
        Newton(module, some.q).until(1e-3, open_by)
    assert np.abs(open_by - some.q).max() > 1e-6  # the float64 models refuse as much
    model = hybridyn.compile(robot, on, dtype="float32")
    tau = model.idm(open_by, some.v, some.a)
    assert model.recomputed == 0
    assert float(abs(tau - whole).max()) == pytest.approx(points["1e-03, C in float32"].error, rel=1e-3)


def test_without_a_compiler_nothing_is_claimed(monkeypatch: pytest.MonkeyPatch) -> None:
    for part in (models, loops):
        monkeypatch.setattr(part, "generated_idm", lambda *_: "no C code: no compiler")
    monkeypatch.setattr(points, "clock", Clock(tick=1e-3))
    robot = hybridyn.load("five_bar")
    study = study_models(robot, motion(robot, 5), choose(robot, "model"), lambda what: None)
    assert study.own_error == UNJUDGED
    assert "as no higher precision is available" in study.reference
    usual = next(p for p in study.points if p.use == "usual")
    assert usual.seconds > usual.own  # closing counts, even without C code
    assert error_words(usual, study) == "< 1e-09"
    assert advice(study, 1e-12).startswith(
        "For 1e-12 on motor efforts no configuration that was tried suffices"
    )


def test_a_spline_is_not_compared_with_its_own_rates() -> None:
    robot = hybridyn.load("five_bar")
    some = motion(robot)
    at = [robot.q_slices[robot.joint_index[motor]].start for motor in robot.motors]
    rates = derivatives(some.time, some.q[:, at], slice(0, len(some.q)))
    motors = {
        m: (some.q[:, k], rates[0][:, i], rates[1][:, i])
        for i, (m, k) in enumerate(zip(robot.motors, at, strict=True))
    }
    q, v, a = hybridyn.assemble(robot, motors=motors, guess=some.q[0])
    spline, differences = by_rates(robot, some.time, q, v, a, choose(robot, None))
    assert "nothing to compare with" in spline.failure
    assert differences.use == "comparison"
    assert [p.failure[:12] for p in by_rates(robot, None, q, v, a, choose(robot, None))] == ["not measured"]


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(settings, "FACTORS", (8.0, 4.0))
    monkeypatch.setattr(settings, "TOLERANCES", (1e-3, 1e-7))
    monkeypatch.setattr(runs, "LADDER", (1e-8, 1e-10, 1e-12))


SWING = ROOT / "models/five_bar/swing.toml"


@pytest.fixture(scope="module")
def swing() -> Study:
    """Measure the beginning of the swing once for all tests that use it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(settings, "FACTORS", (8.0, 4.0))
        patch.setattr(settings, "TOLERANCES", (1e-3, 1e-7))
        patch.setattr(runs, "LADDER", (1e-8, 1e-10, 1e-12))
        return study_runs(stage(SWING), 0.05, lambda what: None)


@pytest.fixture
def measured(swing: Study, monkeypatch: pytest.MonkeyPatch) -> None:
    """Replace the measurement of the command by the one of `swing`."""
    monkeypatch.setattr(runs, "study_runs", lambda *_: swing)


@pytest.mark.slow
def test_a_scene_on_the_command_line(
    tmp_path: Path, measured: None, capsys: pytest.CaptureFixture[str]
) -> None:
    table, figure = tmp_path / "cost.csv", tmp_path / "cost.svg"
    out = call(capsys, "cost", SWING, "--until", "0.05", "-o", table, "--plot", figure)
    assert "its own error" in out.out
    rows = list(csv.DictReader(table.read_text().splitlines()))
    error = {(row["line"], row["setting"].split(" (")[0]): float(row["error"]) for row in rows}
    by_line = {row["line"]: [float(r["error"]) for r in rows if r["line"] == row["line"]] for row in rows}
    assert 8 < by_line["rk4"][0] / by_line["rk4"][1] < 40  # fourth order: 16, when steps are halved
    assert 3 < by_line["conserving"][0] / by_line["conserving"][1] < 5  # second order: 4
    in_c = by_line["rk4, C in float64"]  # in other coordinates: of the same order, not of the same size
    assert 8 < in_c[0] / in_c[1] < 40
    assert by_line["rk4"][0] / 5 < in_c[0] < 5 * by_line["rk4"][0]
    assert by_line["rk4, C in float32"] == pytest.approx(by_line["rk4"], rel=0.1, abs=1e-6)
    assert error["as the scene says", "conserving, step 0.001 s"] < 1e-4
    assert {row["use"] for row in rows if "never" in row["line"]} == {"comparison"}
    assert not [row for row in rows if "never" in row["line"] and row["on_front"] == "1"]
    assert figure.read_text().startswith("<?xml")


@pytest.mark.slow
@pytest.mark.parametrize("target", [1e-3, 1e-8])
def test_the_lines_of_a_target_run_and_reach_it(
    target: float, tmp_path: Path, measured: None, capsys: pytest.CaptureFixture[str]
) -> None:
    out = call(capsys, "cost", SWING, "--until", "0.05", "--target", target)
    assert (out.status, out.err) == (0, "")
    pasted = tomllib.loads(out.out)["solver"]
    ready = stage(SWING)
    tight = {"method": "dopri5", "rtol": 1e-12, "atol": 1e-14}
    ends = [
        hybridyn.simulate(ready.robot, ready.q0, ready.v0, (0.0, 0.05), effects=ready.effects, **how).q[-1]
        for how in (pasted, tight)
    ]
    assert distance(ready.robot, *ends) <= target
    text = SWING.read_text().replace("../../", f"{ROOT}/").replace("duration = 2.0", "duration = 0.05")
    before, rest = text.split("[solver]")
    mine = save(tmp_path, before + out.out + "\n[output]" + rest.split("[output]")[1], "mine.toml")
    call(capsys, "simulate", mine, "-o", tmp_path / "run.csv")


@pytest.mark.slow
def test_a_target_out_of_reach_prints_nothing_to_paste(
    measured: None, capsys: pytest.CaptureFixture[str]
) -> None:
    call(
        capsys,
        "cost",
        SWING,
        "--until",
        "0.05",
        "--target",
        "1e-30",
        status=1,
        says="no configuration that was tried suffices: the least error is",
    )


def test_effects_to_leave_out_of_a_scene() -> None:
    ready = stage(ROOT / "models/lx4/sag.toml")
    chosen = list(settings.of_effects(ready.effects.names, settings.own_options(ready)))
    assert [s.words for s in chosen][::3] == [
        "without leg inertia",
        "without leg inertia and velocity and viscous friction",
    ]
    for setting in chosen:
        lines = tomllib.loads(effects_fragment(ready.source, setting.effects or ()))
        left = lines["effects"]["use"]
        assert "payload" not in left  # its own table stays in the scene
        assert {*left, "payload"} == {*(setting.effects or ())}


@pytest.mark.slow
def test_an_event_ends_every_run(tmp_path: Path, few: None) -> None:
    text = SWING.read_text().replace("../../", f"{ROOT}/")
    scene = save(
        tmp_path,
        text + '\n[[events]]\njoint = "m1_left_drive"\nat = 0.49\ndirection = "both"\nstop = true\n',
        "event.toml",
    )
    study = study_runs(stage(scene), 2.0, lambda what: None)
    assert "where an event ends it" in study.question
    assert next(p for p in study.points if p.use == "usual").error < 1e-3


def test_runs_that_take_too_long_are_given_up(few: None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runs, "clock", Clock(tick=1.0))
    runner = Runner(stage(SWING), 2.0, 1e-3)
    assert (
        max(s.options["step"] for s in of_integration(typical_step(5, 0.05)) if "step" in s.options) <= 0.05
    )
    lines = list(of_integration(1e-3))[:2]
    refused(lambda: runner.run(lines[0]), TooLongError, r"given up after 0.001 s, at")
    points = list(runs._points(runner, lines, runner.ready.q0, lambda what: None))
    assert points[0].failure.startswith("given up")
    assert points[1].failure.startswith("not tried: the one before was given up")


@pytest.mark.slow
def test_one_row_is_enough(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = (ROOT / "models/five_bar/traj.csv").read_text().splitlines()
    table = save(tmp_path, "\n".join(rows[:2]), "one.csv")
    out = call(capsys, "cost", "five_bar", table, "-o", "-")
    assert [row["use"] for row in csv.DictReader(out.out.splitlines())].count("usual") == 1
    assert "120 rows or more" in out.err


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
