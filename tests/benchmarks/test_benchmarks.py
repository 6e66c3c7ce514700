"""The benchmarks' own arithmetic: the gate refuses, peers agree, references are better, results survive."""

import math
import operator
import os
import shutil
import sys
import time
from functools import partial
from pathlib import Path
from typing import get_type_hints

import numpy as np
import pytest

import hybridyn
from benchmarks import accuracy, callgrind, derivatives, operations, peers, simulation, timing
from benchmarks.__main__ import COMMITTED, collect, store
from benchmarks.callgrind import by_library
from benchmarks.cases import LX4_TRAJECTORY, case_of, stack_motion, write_long_trajectory
from benchmarks.fronts import cheapest
from benchmarks.goals import reached
from benchmarks.hard import page
from benchmarks.history import changes
from benchmarks.panels import Curve, Panel, draw
from benchmarks.peers import rk4
from benchmarks.plan import Cache, Task, fingerprint
from benchmarks.reference import (
    DDM_LIMIT,
    Reference,
    WrongModelError,
    digits,
    extended,
    floor,
    refer,
    refuse,
    relative,
)  # fmt: skip
from benchmarks.report import read_results, report
from benchmarks.results import (
    CHECK,
    SECTIONS,
    Row,
    machine,
    measured_on,
    read_machines,
    read_rows,
    read_table,
    write_rows,
)  # fmt: skip
from benchmarks.simulation import MOTIONS, start
from benchmarks.singular import APPROACHES, load
from benchmarks.timing import in_own_process, interleaved
from hybridyn.compiled.programs.whole_robot import programs
from hybridyn.dynamics import direct
from hybridyn.studies.compare.engines import mujoco_engine
from hybridyn.studies.compare.peer_engine import NotComparableError
from hybridyn.studies.cost.points import pareto_front
from tests import ROOT
from tests.support.clocks import Clock
from tests.support.comparing import refused
from tests.support.extras import needs
from tests.support.files import save
from tests.support.samples import slow

DIFFERENCES = 1e-3  # of the largest rate: second-order central differences at 5 ms of a motion of 1 Hz
REACHED = {  # soft closures; another robot's efforts; seven digits
    "MuJoCo": 1e-2, "pin.rnea, loops open": math.inf, "hybridyn, compiled, float32": 1e-3,
}  # fmt: skip
AGREES = 1e-11  # every other method, at its best setting, on robots of condition 1e3
FINER = 1e-17  # long double against 40 digits, on one module
STEPS = 1e-5  # RK4 at 2 ms in two coordinates of the same motion, 10 ms
PYTHONS = 0.01  # what the interpreter's own count moves by from run to run, tenfold
NAN = math.nan


# ------------------------------------------------------------------ gate, references


@pytest.mark.parametrize("error", [2 * DDM_LIMIT, float("nan")])
def test_gate_refuses_a_wrong_model(error: float) -> None:
    refused(
        lambda: refuse(error, DDM_LIMIT, "ddm of 4 modules"),
        WrongModelError,
        r"ddm of 4 modules: error .*, limit 1e-10",
    )


def test_nothing_is_timed_of_a_wrong_model(monkeypatch: pytest.MonkeyPatch) -> None:
    right = direct.ddm
    monkeypatch.setattr(direct, "ddm", lambda *given: right(*given) * (1 + 1e-8))
    monkeypatch.setattr(accuracy, "measured", lambda *_, **__: pytest.fail("timed"))
    refused(
        lambda: accuracy.measure("ddm", "five_bar", accuracy.Effort(1, (1, 4), rounds=1, sweep=100)),
        WrongModelError,
        r"hybridyn, general, 1 samples of five_bar: error 1.0e-08",
    )


def test_error_is_relative_to_the_largest_entry() -> None:
    assert relative(np.array([1.0, 100.0]), np.array([2.0, 100.0])) == 0.01
    two = Reference(np.array([[1.0, 10.0], [1.0, 2.0]]), 0.0, "")
    assert two.off(np.array([[1.0, 10.5], [1.0, 2.0]])) == 0.05
    assert two.off(np.array([[1.0, 10.5], [1.0, math.nan]])) == math.inf


@pytest.mark.skipif(np.finfo(np.longdouble).eps > 1e-18, reason="long double is no longer than double")
@pytest.mark.parametrize("model", ["ddm", "idm"])
def test_long_double_reference_against_forty_digits(model: str) -> None:
    own = case_of("five_bar")
    robot = own.load()
    q, v, a = own.states(robot, 2)
    given = a if model == "idm" else hybridyn.idm(robot, q, v, a)
    exact = digits(robot, model, q, v, given)  # type: ignore[arg-type]
    found, gain = extended(robot, model, q, v, given)  # type: ignore[arg-type]
    assert Reference(exact, 0.0, "").off(found) < FINER
    assert gain < 1e-3
    assert refer(robot, model, q, v, given).kind == "40 digits"  # type: ignore[arg-type]
    assert floor(robot, q[0], v[0], hybridyn.idm(robot, q, v, a)[0]) < 1e-14


# ------------------------------------------------------------------ peers


@pytest.mark.parametrize("case", ["five_bar", slow("rps3"), slow("stack 2"), slow("ur5")])
def test_every_method_agrees_with_the_reference(case: str) -> None:
    needs("bench")
    own = case_of(case)
    robot = own.load()
    q, v, a = own.states(robot, 2)
    tau = hybridyn.idm(robot, q, v, a)
    agreed = set()
    for model, given in (("ddm", tau), ("idm", a)):
        reference = Reference(extended(robot, model, q, v, given)[0], 0.0, "")  # type: ignore[arg-type]
        for method in peers.methods_of(model):  # type: ignore[arg-type]
            try:
                at = method.prepare(robot)
            except NotComparableError:
                continue
            states = list(zip(q, v, given, strict=True))
            errors = [
                reference.off(np.array([at(s)(*state) for state in states])) for s in method.settings[::2]
            ]
            assert min(errors) < REACHED.get(method.name, AGREES), method
            agreed.add((model, method.name))
            if method.batches:
                assert reference.off(at({})(q, v, given)) < REACHED.get(method.name, AGREES)
    assert {("ddm", "hybridyn, general"), ("ddm", "pin.lcaba"), ("ddm", "MuJoCo")} <= agreed
    assert ("idm", "pin.rnea" if case == "ur5" else "pin.rnea + projection, per module") in agreed


def test_methods_say_what_they_cannot_do(monkeypatch: pytest.MonkeyPatch) -> None:
    by_name = {(m.model, m.name): m for m in peers.METHODS}
    robot = hybridyn.load("five_bar")
    refused(lambda: by_name["ddm", "pin.aba"].prepare(robot), NotComparableError, "it has loops")
    refused(
        lambda: by_name["ddm", "pin.lcaba"].check_size(401),
        NotComparableError,
        "not tried above 400 velocities",
    )
    monkeypatch.setitem(sys.modules, "mujoco", None)
    refused(lambda: by_name["ddm", "MuJoCo"].prepare(robot), NotComparableError, "mujoco is not installed")
    assert {m.name for m in peers.METHODS if m.threads} == {
        "hybridyn, compiled",
        "hybridyn, compiled, float32",
    }


def test_closures_that_pinocchio_cannot_state_are_refused(tmp_path: Path) -> None:
    text = (load(APPROACHES["slider-crank, dead centre"]).description.source or "").strip()
    path = save(tmp_path, Path(text).read_text().replace('type="spherical"', 'type="planar"'), "cross.urdf")
    robot = hybridyn.load(path, rank_tolerance=1e-6)
    for method in peers.METHODS:
        if method.name in ("pin.lcaba", "pin.constraintDynamics"):
            refused(partial(method.prepare, robot), NotComparableError, "has no constraint for pin")


@pytest.mark.parametrize(
    ("solver", "hold"), [*(("constraintDynamics", hold) for hold in rk4.HOLDS), ("lcaba", "nothing")]
)
def test_rk4_on_pinocchios_solvers_flies_the_same_motion(solver: str, hold: str) -> None:
    at = start(MOTIONS["five_bar, let go, 1 s"], 0.01)
    q, v, _ = rk4.prepare(at.robot, at.q, at.v, at.effort, at.duration, 2e-3, solver, hold)()
    expected_q, expected_v, _ = at.simulate({"method": "rk4", "step": 2e-3})
    assert np.abs(q - expected_q).max() < STEPS
    assert np.abs(v - expected_v).max() < STEPS * np.abs(v).max()
    if hold == "projection":
        assert hybridyn.closure_residual(at.robot, q[1:]).max() < rk4.CLOSED


def test_mujoco_gives_a_state_back() -> None:
    needs("bench")
    own = case_of("rps3")
    robot = own.load()
    q, v, _ = own.states(robot, 1)
    translated = mujoco_engine.closed(robot)
    translated.place(q[0], v[0])
    for found, given in zip(translated.state(), (q[0], v[0]), strict=True):
        assert np.abs(found - given).max() < 1e-15


@pytest.mark.parametrize("name", list(APPROACHES))
def test_states_near_singular_postures_are_closed(name: str) -> None:
    approach = APPROACHES[name]
    robot = load(approach)
    for distance in (1.0, 1e-3):
        before, (q, v, _), after = (approach.state(distance + h) for h in (-1e-6, 0.0, 1e-6))
        assert hybridyn.closure_residual(robot, q).max() < 1e-15
        assert np.abs((after[0] - before[0]) / 2e-6 - v).max() < 1e-8


def test_pivots_are_not_chosen_by_a_singular_home() -> None:
    robot = load(APPROACHES["parallelogram, flat"])
    assert set(programs(robot)) >= {"ddm", "idm"}


# ------------------------------------------------------------------ motions


def test_rates_of_the_motion_are_its_derivatives() -> None:
    for pose, twist, acceleration in stack_motion(2, 50).values():
        for value, rate in ((pose[:, :3], twist[:, :3]), (twist, acceleration)):
            found = (value[2:] - value[:-2]) / 0.01
            assert np.abs(found - rate[1:-1]).max() < DIFFERENCES * np.abs(rate).max()


def test_long_trajectory_repeats_the_shipped_one(tmp_path: Path) -> None:
    path = tmp_path / "long.csv"
    write_long_trajectory(path, 1500)
    long = np.loadtxt(path, delimiter=",", skiprows=1)
    short = np.loadtxt(LX4_TRAJECTORY, delimiter=",", skiprows=1)
    assert long.shape == (1500, short.shape[1])
    assert np.array_equal(long[1000:, 1:], short[:500, 1:])
    assert np.allclose(np.diff(long[:, 0]), 0.005)


# ------------------------------------------------------------------ running


def test_calls_are_timed_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = Clock()
    monkeypatch.setattr(timing, "time", clock)

    def takes(seconds: float) -> None:
        clock.now += seconds

    slow, fast = interleaved([lambda: takes(3e-3), lambda: takes(1e-4)], 3)
    assert slow == pytest.approx((3e-3, 3e-3))
    assert fast == pytest.approx((1e-4, 1e-4))


def refuse_it() -> None:
    raise WrongModelError("a: error 1, limit 0")


def test_processes_of_their_own() -> None:
    assert in_own_process(operator.add, 1, 2) == 3
    refused(lambda: in_own_process(int, "a"), ValueError, "invalid literal for int")
    refused(lambda: in_own_process(os._exit, 7), NotComparableError, r"died \(exit status 7\)")
    refused(lambda: in_own_process(time.sleep, 1e6, patience=0.1), NotComparableError, "given up")


def test_a_wrong_model_costs_its_section_and_the_exit_status() -> None:
    right = Task("idm", "b", lambda: [Row("five_bar")], ())
    collected, failed = collect([Task("ddm", "a", refuse_it, ()), right], None)
    assert list(collected) == ["idm"]
    assert [line.splitlines()[0] for line in failed] == ["failed: ddm, a: a: error 1, limit 0"]


def test_jobs_are_remembered_as_long_as_nothing_changed(tmp_path: Path) -> None:
    cache, task = Cache(tmp_path, "code 1"), Task("ddm", "five_bar", accuracy.measure, ("ddm", "five_bar"))
    rows = [Row("five_bar", CHECK, setting="a", error=1e-12), Row("five_bar", "ddm", "x", error=0.1, us=2.0)]
    assert cache.get(task) is None
    cache.put(task, rows, {"cores": "4"})
    found, facts = cache.get(task) or ([], {})
    assert [repr(row) for row in found] == [repr(row) for row in rows]
    assert facts == {"cores": "4"}
    assert Cache(tmp_path, "code 2").get(task) is None
    assert cache.get(Task("ddm", "five_bar", accuracy.measure, ("idm", "five_bar"))) is None
    cache.path(task).write_text("{")
    assert cache.get(task) is None


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("valgrind") is None, reason="valgrind is not installed")
def test_instructions_in_a_compiled_library_repeat(tmp_path: Path) -> None:
    callgrind.prepare("five_bar", "idm", tmp_path)
    method = next(m for m in peers.methods_of("idm") if m.name == "hybridyn, compiled")
    (total, own), (again, same) = (callgrind.counted("five_bar", method, 1, tmp_path) for _ in range(2))
    assert 0 < own == same < total
    assert abs(again - total) < PYTHONS * total


def test_without_valgrind_counts_are_not_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(callgrind.shutil, "which", lambda _: None)
    (row,) = callgrind.measure("five_bar", "idm")
    assert (row.method, row.note) == ("every method", "valgrind is not installed")
    assert math.isnan(row.value)


def test_callgrind_costs_by_library() -> None:
    text = """events: Ir
ob=(1) /usr/bin/python3
fn=(1) main
10 5
+2 7
cob=(2) /cache/hybridyn/lx4.so
cfn=(2) ddm
calls=3 0
12 900
ob=(2)
fn=(2)
* 300
summary: 312
"""
    assert by_library(text) == {"/usr/bin/python3": 12.0, "/cache/hybridyn/lx4.so": 300.0}


# ------------------------------------------------------------------ what the results say


def points(*pairs: tuple[float, float]) -> list[Row]:
    return [Row("lx4", "ddm", "pin.lcaba", f"{us}", error=error, us=us) for us, error in pairs]


def test_front_and_cheapest() -> None:
    swept = points((1, 1e-3), (2, 1e-2), (3, 1e-11), (4, math.inf), (5, 1e-12), (6, 1e-11), (NAN, 0.0))
    assert [p.us for p in pareto_front(swept, lambda p: p.us, lambda p: p.error)][:3] == [1, 3, 5]
    best, most = cheapest(swept), cheapest(swept, 1e-13)
    assert (best.us, most.us) == (3, 5)
    assert cheapest([]) is None


@pytest.mark.slow
def test_an_excavator_follows_its_reference_by_computed_torque() -> None:
    few = {"rtol": (1e-7,), "rk4": (5e-4,), "python": (), "mujoco": (5e-4,)}
    check, *rows = simulation.controlled(simulation.EXCAVATOR, few, 0.2)
    assert check.error < 1e-10
    for row in rows:
        if math.isfinite(row.seconds):  # MuJoCo may be absent
            assert row.error < (1e-2 if row.method.startswith("MuJoCo") else 1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("case", ["five_bar", "ur5"])
def test_derivatives_are_measured_beside_pinocchio(case: str) -> None:
    rows = derivatives.measure(case, 2, 1)
    points = [row for row in rows if math.isfinite(row.us)]
    own = [row for row in points if row.method == "hybridyn, compiled"]
    assert {(row.model, row.batch) for row in own} == {
        (model + over, batch)
        for model in ("idm_jacobian", "ddm_jacobian")
        for over in ("", derivatives.MOTORS)
        for batch in (1, 2)
    }
    assert max(row.error for row in own) < AGREES
    others = {row.method: row.error for row in points if row.method.startswith("pin.")}
    if case == "five_bar":
        assert list(others) == ["pin.computeConstraintDynamicsDerivatives"]
    else:
        assert max(others[f"pin.compute{name}Derivatives"] for name in ("RNEA", "ABA")) < AGREES


@pytest.mark.slow
def test_the_peak_is_out_of_reach_and_said_beside_it() -> None:
    rows = operations.measure("five_bar")
    shares = [row for row in rows if row.setting == "share of the peak rate"]
    assert [row.model for row in shares] == ["ddm", "idm"]
    assert all(0.0 < row.value < 1.0 for row in shares)
    said = report({name: [] for name in SECTIONS} | {"peak": rows}, {}, [])
    assert ("share of the peak rate" in said) == any(row.value < 0.6 for row in shares)


def test_rows_survive_their_file(tmp_path: Path) -> None:
    values, types = {str: "a, b", int: 3, float: 1.25e-13}, get_type_hints(Row)
    full = Row(*(values[t] for t in types.values()))
    for rows in ([full, Row("alone")], [Row("alone", us=2.5)], []):
        write_rows(tmp_path / "rows.csv", rows)
        assert [repr(row) for row in read_rows(tmp_path / "rows.csv")] == [repr(row) for row in rows]
    assert read_rows(tmp_path / "none.csv") == []


def test_a_section_alone_leaves_the_others(tmp_path: Path) -> None:
    first, second = points((1.0, 1e-12)), points((2.0, 1e-12))
    store(tmp_path, {"idm": (first, {"cores": "1"}), "ddm": (first, {"cores": "1"})})
    store(tmp_path, {"ddm": (second, {"cores": "2"})})
    found = [repr(read_rows(tmp_path / f"{section}.csv")) for section in ("idm", "ddm")]
    assert found == [repr(first), repr(second)]
    assert read_machines(tmp_path / "machine.csv") == {"ddm": {"cores": "2"}, "idm": {"cores": "1"}}


def test_goals_are_ratios_of_the_best_rows() -> None:
    results: dict[str, list[Row]] = {name: [] for name in SECTIONS}
    assert all(math.isnan(one.value) for one in reached(results))
    ours = [
        Row("lx4", "ddm", "hybridyn, compiled", error=error, us=us)
        for us, error in ((1.0, 1e-3), (2.0, 1e-13))
    ]
    results["ddm"] = [*points((10, 1e-11), (5, 1e-3), (NAN, 0.0)), *ours]
    values = [one.value for one in reached(results) if one.goal.section == "ddm" and one.case == "lx4"]
    assert values[0] == 0.2
    assert math.isnan(values[1])


def test_ratios_that_grow_are_warned_of_and_no_others() -> None:
    """The time of the peer falls out: only the ratio counts, and only where both runs have it."""

    def results(ours: float, peer: float, *cases: str) -> dict[str, list[Row]]:
        rows = [
            Row(case, "ddm", method, error=1e-13, us=us)
            for case in cases
            for method, us in (("hybridyn, compiled", ours), ("pin.lcaba", peer))
        ]
        return {name: rows if name == "ddm" else [] for name in SECTIONS}

    before = results(1.0, 10.0, "lx4", "tanev")
    assert [*changes(results(10.0, 100.0, "lx4", "delta"), before)] == [
        "lx4, ddm, hybridyn, compiled: 0.1 times the time of the fastest peer, 0.1 in the committed rows"
    ]
    assert [line.split(":")[0] for line in changes(results(2.1, 10.0, "lx4"), before)] == ["warning"]


def test_a_panel_of_rounding_says_zero() -> None:
    def panels(*tops: float) -> list[Panel]:
        return [Panel("p", "x", "y", [Curve("c", "#000000", [1.0, 2.0], [top, top / 2])]) for top in tops]

    for tops, zeros in (((1.0, 1e-13), 1), ((1e-13, 1e-14), 0)):
        axes = draw("t", "r", [panels(*tops)]).axes
        assert [text.get_text() for ax in axes for text in ax.texts] == ["zero"] * zeros


def test_a_section_that_is_not_measured_says_so() -> None:
    said = report({name: [] for name in SECTIONS}, {}, [])
    for section in ("cold", "effects"):
        assert f"python -m benchmarks --full --only {section}" in said


def test_committed_report_is_that_of_the_committed_results() -> None:
    folder = COMMITTED / "results"
    drawn = [path.stem for path in (COMMITTED / "figures").glob("*.svg")]
    expected = report(read_results(folder), read_machines(folder / "machine.csv"), drawn)
    assert (COMMITTED / "report.md").read_text() == expected, "run python -m benchmarks --report"


def test_pages_name_machine_and_day_of_the_rows_that_they_show() -> None:
    """Of those in the overview; machines and days of others stand in the report beside them."""
    machines = read_machines(COMMITTED / "results" / "machine.csv")
    said = f"Measured: {measured_on(machines, ['ddm', 'scaling'])}."
    for shown in ("README.md", "docs/index.md"):
        assert said in " ".join((ROOT / shown).read_text().split())
    dated = {name for name, facts in machines.items() if "date" in facts}
    assert {name for name, rows in read_results(COMMITTED / "results").items() if rows} <= dated


def test_a_run_knows_its_day_and_its_jobs_are_remembered_the_next(monkeypatch: pytest.MonkeyPatch) -> None:
    before = fingerprint()
    monkeypatch.setattr("benchmarks.results.today", lambda: "2031-02-03")
    facts = machine() | {"processor": "P", "cores": "2"}
    assert measured_on({"ddm": facts, "idm": facts}, ["ddm", "idm", "cold"]) == (
        "ddm, idm: 2031-02-03, P, 2 cores; cold: day not recorded, machine not recorded"
    )
    assert fingerprint() == before


def test_committed_hard_cases_name_tests_that_exist() -> None:
    """Names of tests that were renamed are carried over by hand, until the hard cases are measured again."""
    folder = COMMITTED / "results"
    claims = read_table(folder / "hard.csv")
    assert (COMMITTED / "hard.md").read_text() == page(claims), "run python -m benchmarks --report"
    named = [row["test"].partition("::") for row in claims]
    named += [(row["file"], "", row["test"]) for row in read_table(folder / "slow.csv")]
    missing = {(file, test) for file, _, test in named if f"def {test}(" not in (ROOT / file).read_text()}
    assert not missing
