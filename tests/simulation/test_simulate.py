"""simulate: motions derived by hand, events, dense output, resuming, determinism, and what it refuses."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import hybridyn
from hybridyn import Event, near_singularity, simulate
from hybridyn.description.records import Description, Joint, Link
from hybridyn.effects import BaseMotion
from hybridyn.errors import AssemblyError, TrajectoryError
from hybridyn.manifold.manifold import Manifold
from hybridyn.simulation.result import SimulationResult
from hybridyn.structure.building import build_robot
from tests.robots.robot_texts import door, save
from tests.robots.swings import chain, equal_bits, hinge, rod, still_base, swing
from tests.support.comparing import refused

REFERENCE = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}  # of the motions derived by hand
TIGHT = {"rtol": 1e-11, "atol": 1e-12}  # asked of simulate
MINIMAL = 1e-8  # what it then reaches over a second
CLOSED = 1e-10  # the project's claim on closures
SAME_STEPS = 1e-10  # of equal motions by equal steps: rounding, and iterations that end there
G = 9.81


# -------------------------------------------------------------------- motions derived by hand


def test_double_pendulum(tmp_path: Path) -> None:
    """Two rods hanging one from the other.

    With a = q1, b = q1 + q2 and d = a - b, Lagrange's equations of two rods are
    (I1 + m1 c1^2 + m2 l1^2) a'' + m2 l1 c2 (cos d b'' + sin d b'^2) + (m1 c1 + m2 l1) g sin a = 0,
    (I2 + m2 c2^2) b'' + m2 l1 c2 (cos d a'' - sin d a'^2) + m2 c2 g sin b = 0.
    """
    m1, m2, l1, c1, c2, i1, i2 = 1.3, 0.7, 0.8, 0.4, 0.3, 0.05, 0.03
    robot = chain(
        tmp_path,
        rod("upper", m1, f"0 0 {-c1}", (0.1, i1, 0.1)) + rod("lower", m2, f"0 0 {-c2}", (0.1, i2, 0.1)),
        hinge("q1", "base", "upper") + hinge("q2", "upper", "lower", f"0 0 {-l1}"),
    )

    def rates(t: float, x: np.ndarray) -> np.ndarray:
        a, b, a_dot, b_dot = x
        c, s = m2 * l1 * c2 * np.cos(a - b), m2 * l1 * c2 * np.sin(a - b)
        M = np.array([[i1 + m1 * c1**2 + m2 * l1**2, c], [c, i2 + m2 * c2**2]])
        f = [-s * b_dot**2 - (m1 * c1 + m2 * l1) * G * np.sin(a), s * a_dot**2 - m2 * c2 * G * np.sin(b)]
        return np.concatenate([x[2:], np.linalg.solve(M, f)])

    q, v, times = np.array([1.0, 0.5]), np.array([0.2, -1.0]), np.linspace(0, 0.02, 4)
    exact = solve_ivp(rates, (0, 0.02), [q[0], q.sum(), v[0], v.sum()], t_eval=times, **REFERENCE).y.T
    result = simulate(robot, q, v, times, **TIGHT)
    assert np.abs(np.cumsum(result.q, axis=1) - exact[:, :2]).max() < MINIMAL
    assert np.abs(np.cumsum(result.v, axis=1) - exact[:, 2:]).max() < 10 * MINIMAL
    assert np.abs(result.energy - result.energy[0]).max() < MINIMAL


# -------------------------------------------------------------------- closures, drift, outputs


@pytest.mark.parametrize("name", ["five_bar", "serial_all:fixed"])
def test_dense_output_is_as_good_as_the_steps(name: str) -> None:
    robot, q, v = swing(name)
    times = np.linspace(0, 0.05, 12)
    fine = simulate(robot, q, v, times, **TIGHT)
    coarse = simulate(robot, q, v, times, rtol=1e-6, atol=1e-6)
    assert coarse.counters.steps < fine.counters.steps
    difference = Manifold(robot).retraction.difference
    assert max(np.abs(difference(x, y)).max() for x, y in zip(coarse.q, fine.q, strict=True)) < 1e-4
    assert coarse.residual.max() <= CLOSED
    assert list(coarse.t) == list(times)


def test_results_are_states_of_the_direct_model() -> None:
    robot, q, v = swing("five_bar")
    tau = np.array([1.0, -2.0])
    wrench = {robot.description.links[-1].name: np.arange(6.0)}
    result = simulate(robot, q, v, (0, 0.02), effort=lambda t, q, v: tau * t, wrenches=wrench)
    assert np.array_equal(result.tau, result.t[:, None] * tau)
    expected = hybridyn.ddm(robot, result.q, result.v, result.tau, wrenches=wrench)
    assert np.abs(result.a - expected).max() < 1e-9 * np.abs(expected).max()


def test_rows_of_the_output_call_the_controller_once() -> None:
    robot, q, v = swing("five_bar")
    asked: list[float] = []

    def effort(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        asked.append(t)
        return np.array([t, -t])

    times = np.linspace(1e-3, 9e-3, 7)
    simulate(robot, q, v, (0, 0.01), effort=effort, method="rk4", step=0.01, output_times=times)
    assert [asked.count(t) for t in np.delete(times, 3)] == 6 * [1]  # the middle is a stage of the step


def test_a_prescribed_base_carries_the_robot() -> None:
    robot = build_robot(swing("five_bar")[0].description, base="moving")
    t = np.linspace(0, 0.5, 30)
    pose = np.column_stack(
        [0.1 * np.sin(5 * t), 0 * t, 0.05 * t, 0 * t, np.sin(0.3 * t), 0 * t, np.cos(0.3 * t)]
    )
    table = BaseMotion(t, pose)
    q0, v0 = robot.home.copy(), np.zeros(robot.nv)
    result = simulate(robot, q0, v0, (0, 0.02), effects=["default", table])
    assert result.residual.max() <= CLOSED
    assert result.q[-1, 2] == pytest.approx(0.05 * 0.02, rel=1e-6)
    refused(
        lambda: simulate(robot, q0, v0, (0, 0.1)),
        TrajectoryError,
        "is 'moving': a base that is 'moving' needs",
    )


@pytest.mark.parametrize("options", [
    {"rtol": 1e-8}, {"method": "rk4", "step": 0.01}, {"method": "conserving", "step": 0.01},
    {"method": "implicit", "rtol": 1e-4},
], ids=["dopri5", "rk4", "conserving", "implicit"])  # fmt: skip
def test_a_door_with_two_hinges_swings_as_with_one(options: dict[str, object], tmp_path: Path) -> None:
    """A loop over a tree of one freedom, all rows of which say the same; rounding moves adaptive steps."""
    same = options.get("rtol", SAME_STEPS)
    start = np.array([0.3]), np.array([-1.0]), (0, 0.2)
    robots = [hybridyn.load(save(tmp_path, door(count))) for count in (2, 1)]
    two, one = (simulate(robot, *start, **options) for robot in robots)  # type: ignore[arg-type]
    assert two.status == "finished"
    for found, wanted in ((two.t, one.t), (two.q, one.q), (two.v, one.v)):
        assert found == pytest.approx(wanted, abs=same)
    assert two.residual.max() <= CLOSED
    assert np.ptp(two.q) > 0.1


# -------------------------------------------------------------------- events


def test_events_are_found_to_rounding(tmp_path: Path) -> None:
    robot = chain(
        tmp_path,
        rod("mass", 2.0, "0 0 0", (0.1, 0.1, 0.1)),
        hinge("fall", "base", "mass", kind="prismatic", axis="0 0 1"),
    )
    low = Event("low", lambda t, q, v: q[0] + 1.0, -1)
    half = Event("half", lambda t, q, v: q[0] + 0.5, -1, terminal=False)
    up = Event("up", lambda t, q, v: q[0] + 0.5, +1)
    for options in ({}, {"method": "rk4", "step": 0.1}, {"output_times": [0.0, 0.1, 0.3, 1.0]}):
        result = simulate(robot, np.zeros(1), np.zeros(1), (0, 2), events=(low, half, up), **options)  # type: ignore[arg-type]
        assert result.status == "event"
        assert "low" in result.message
        assert [e.name for e in result.events] == ["half", "low"]
        assert result.events[0].t == pytest.approx(np.sqrt(1 / G), rel=1e-12)
        assert result.t[-1] == pytest.approx(np.sqrt(2 / G), rel=1e-12)
        assert result.q[-1, 0] == pytest.approx(-1.0, rel=1e-12)


@pytest.mark.parametrize("method", ["dopri5", "rk4", "implicit", "conserving"])
@pytest.mark.parametrize("top", [1.8, 6**2 / (2 * 9.81) - 1e-3])
def test_an_event_that_passes_and_returns_within_a_step_is_found(method: str, top: float) -> None:
    """A body is thrown up at 6 m/s: in one long step it rises through a height and falls through it."""
    body = Link("body", 1.0, np.zeros(3), np.eye(3))
    links = (Link("ground", 0.0, np.zeros(3), np.zeros((3, 3))), body)
    rail = Joint("rail", "prismatic", "ground", "body", np.eye(4), np.array([0.0, 0.0, 1.0]))
    robot = build_robot(Description("thrown", links, (rail,), (), (), (), ""))
    over = Event("over", lambda t, q, v: q[0] - top, +1)
    under = Event("under", lambda t, q, v: q[0] - top, -1, terminal=False)
    options = {} if method == "dopri5" else {"step": 1.2}
    result = simulate(robot, np.zeros(1), np.array([6.0]), (0, 1.2), events=[over], method=method, **options)  # type: ignore[arg-type]
    rises = (6 - np.sqrt(36 - 2 * 9.81 * top)) / 9.81
    assert result.status == "event"
    assert result.events[0].t == pytest.approx(rises, rel=1e-9)
    result = simulate(robot, np.zeros(1), np.array([6.0]), (0, 1.2), events=[under], method=method, **options)  # type: ignore[arg-type]
    assert [e.t for e in result.events] == [pytest.approx(12 / 9.81 - rises, rel=1e-9)]


def test_approaching_a_singularity_is_an_event() -> None:
    robot, q, v = swing("five_bar")
    pivot = Manifold(robot).chart(q).pivot
    away = near_singularity(robot, 0.98 * pivot)
    assert away.function(0.0, q, v) > 0
    result = simulate(robot, q, 3 * v, (0, 2), events=[away], rtol=1e-6)
    assert result.status == "event"
    assert "singularity of the closures" in result.message
    assert Manifold(robot).chart(result.q[-1]).pivot == pytest.approx(0.98 * pivot, rel=1e-9)
    assert near_singularity(robot, 1e-3, what="motors").function(0.0, q, v) > 0


# -------------------------------------------------------------------- runs


@pytest.mark.parametrize("options", [
    {}, {"method": "rk4", "step": 0.003}, {"method": "conserving", "step": 0.003},
    {"method": "implicit", "rtol": 1e-5},
], ids=["dopri5", "rk4", "conserving", "implicit"])  # fmt: skip
def test_runs_repeat_and_resume_bit_for_bit(options: dict[str, object], tmp_path: Path) -> None:
    robot, q, v = swing("five_bar")
    first = simulate(robot, q, v, (0, 0.06), **options)  # type: ignore[arg-type]
    again = simulate(robot, q, v, (0, 0.06), **options)  # type: ignore[arg-type]
    assert equal_bits(first, again)

    def stop(t: float, end: float) -> None:
        if t > 0.025:
            raise KeyboardInterrupt

    file = tmp_path / "run.npz"
    broken = simulate(robot, q, v, (0, 0.06), progress=stop, checkpoint=file, **options)  # type: ignore[arg-type]
    assert broken.status == "interrupted"
    assert 0.025 < broken.t[-1] < 0.06
    resumed = simulate(robot, None, None, (0, 0.06), resume=file, **options)  # type: ignore[arg-type]
    assert resumed.status == "finished"
    assert equal_bits(first, resumed)
    assert resumed.counters == first.counters
    first.save(tmp_path / "a.npz")
    resumed.save(tmp_path / "b.npz")
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    assert equal_bits(SimulationResult.load(tmp_path / "a.npz"), first)


def test_what_is_out_of_reach_ends_the_run_with_a_message() -> None:
    robot, q, v = swing("five_bar")
    result = simulate(robot, q, 60 * v, (0, 1), method="rk4", step=0.2)
    assert result.status in ("unreachable", "singular")
    assert "m1_right_lower" in result.message
    assert result.t[-1] < 1
    assert result.residual.max() <= CLOSED


def test_velocities_that_open_the_loops() -> None:
    robot, q, v = swing("gough_stewart")
    wrong = v.copy()
    wrong[0] += 0.01
    words = "module 'm1_platform': v0 does not keep the loops closed"
    refused(lambda: simulate(robot, q, wrong, (0, 0.01)), AssemblyError, words, module="m1_platform")
    result = simulate(robot, q, wrong, (0, 0.01), initial_velocity="project")
    assert result.status == "finished"
    assert Manifold(robot).opening(result.q[0], result.v[0])[0] < 1e-12
    apart = q + 1e-3 * wrong
    refused(lambda: simulate(robot, apart, v, (0, 0.01)), AssemblyError, "q0 does not close the loops")


@pytest.mark.parametrize(("options", "message"), [
    ({"method": "euler"}, "unknown method 'euler'"),
    ({"method": "rk4"}, "takes fixed steps"),
    ({"step": -1.0}, "step must be positive"),
    ({"rtol": np.nan}, "rtol must be positive"),
    ({"initial_velocity": "guess"}, "initial_velocity must be"),
    ({"times": (0.0,)}, "at least 2"),
    ({"times": (0.0, 1.0, 0.5)}, "all rise or all fall"),
    ({"effort": np.zeros(3)}, "effort must be 2"),
    ({"effort": lambda t, q, v: np.zeros(1)}, "expected 2 finite"),
    ({"effects": ["default", still_base()]}, "is 'fixed'"),
])  # fmt: skip
def test_wrong_arguments(options: dict[str, object], message: str) -> None:
    robot, q, v = swing("five_bar")
    times = options.pop("times", (0.0, 0.01))
    refused(lambda: simulate(robot, q, v, times, **options), TrajectoryError, message)  # type: ignore[arg-type]


def test_files_that_are_no_result(tmp_path: Path) -> None:
    (tmp_path / "text.npz").write_text("no")
    np.savez(tmp_path / "other.npz", t=np.zeros(1))
    for name in ("text.npz", "other.npz"):
        refused(partial(SimulationResult.load, tmp_path / name), TrajectoryError, "not a result")


@pytest.mark.parametrize(("word", "meant"), [("dt", "step"), ("metod", "method"), ("tau", "effort")])
def test_arguments_of_other_programs_are_told_apart(word: str, meant: str) -> None:
    robot = hybridyn.load("five_bar")
    asked = partial(simulate, robot, robot.home, np.zeros(robot.nv), (0, 1), **{word: 1.0})
    refused(asked, TypeError, f"no argument '{word}' \\(did you mean '{meant}'")
