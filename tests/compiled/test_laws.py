"""Laws of efforts in time steps in C: controllers, and programs in Python; against the loop in Python."""

import ctypes
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.compiled.library.laws import Law
from hybridyn.compiled.library.steps import Steps, Taken
from hybridyn.compiled.programs.control import closing_of_motors
from hybridyn.effects import Limits
from hybridyn.scenes import controllers
from hybridyn.scenes.prescribed import follow_motion
from hybridyn.scenes.references import MotorAxes, Reference, RestPosture, from_points
from hybridyn.simulation import stepping
from hybridyn.simulation.result import SimulationResult
from hybridyn.simulation.runge_kutta import RK4, Explicit
from tests.support.comparing import close_to, refused, same_bits

LEFT, RIGHT = "m1_left_drive", "m1_right_drive"
SOLVED = 1e-12  # two solutions of the loops and of the inertia, relative
STIFF = (100.0, 8.0)  # gains [N m/rad, N m s/rad]
LIMIT = 1e3  # above what the five-bar needs [N m], as in test_steps.py
BOUND = 3.0  # clips some efforts [N m]
FIXED: dict[str, Any] = {"method": "rk4", "step": 1e-3}
ADAPTIVE: dict[str, Any] = {"method": "dopri5", "rtol": 1e-8, "atol": 1e-10}
Run = Callable[..., SimulationResult]


@pytest.fixture(scope="module")
def model() -> hybridyn.CompiledRobot:
    robot = hybridyn.load("five_bar")
    return hybridyn.compile(robot, effects=["default", Limits(dict.fromkeys(robot.motors, LIMIT))])


@pytest.fixture(scope="module")
def reference(model: hybridyn.CompiledRobot) -> Reference:
    left, right = model.robot.motors
    points = [
        RestPosture(0.0, {}, {}),
        RestPosture(0.05, {left: 0.3}, {}),
        RestPosture(0.08, {left: 0.1, right: -0.2}, {}),
    ]
    return from_points(model.robot, points, model.robot.home)


@pytest.fixture(scope="module")
def laws(model: hybridyn.CompiledRobot, reference: Reference) -> dict[str, Any]:
    times, tau = np.array([0.0, 0.03, 0.2]), np.array([[0.0, 4.0], [20.0, -3.0], [5.0, 1.0]])
    return {
        "table": controllers.EffortTable(times, tau),
        "pd": controllers.Pd(model.robot, reference, *STIFF),
        "torque": controllers.ComputedTorque(model.robot, reference, 900.0, 60.0),
    }


@pytest.fixture
def flown(model: hybridyn.CompiledRobot) -> Run:
    """A run from rest beside the reference."""

    def fly(law: Any, end: float = 0.1, **options: Any) -> SimulationResult:
        robot = model.robot
        q, v, _ = hybridyn.assemble(robot, motors=dict.fromkeys(robot.motors, 0.05))
        options = FIXED | options
        return hybridyn.simulate(
            robot, q, v, (0, end), effort=law, effects=model.effects, compiled=model, **options
        )

    return fly


def levels(run: SimulationResult) -> tuple[np.ndarray, ...]:
    """Return what a run computes at its times."""
    return run.t, run.q, run.v, run.a, run.tau, run.pivot


@pytest.mark.parametrize("name", ["table", "pd", "torque"])
def test_laws_in_c_are_those_in_python(
    model: hybridyn.CompiledRobot, laws: dict[str, Any], name: str
) -> None:
    """At times within the reference, at its ends, and at rest after it."""
    law, steps = laws[name], model.library.steps
    t = np.array([0.0, 0.013, 0.05, 0.061, 0.08, 0.19])
    x = {motor: (0.1 * np.sin(t + k), np.cos(9 * t), 0 * t) for k, motor in enumerate(model.robot.motors)}
    q, v, _ = hybridyn.assemble(model.robot, motors=x)
    made = law.in_c(model)
    ours = steps.efforts(made, t, q, v)
    theirs = np.array([law(*state) for state in zip(t, q, v, strict=True)])
    agree = SOLVED * np.abs(theirs).max() if name == "torque" else 0.0
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=agree)
    bound = np.full(len(model.robot.motors), BOUND)
    clipped = steps.efforts(made.bounded(bound), t, q, v)
    np.testing.assert_array_equal(clipped, np.clip(ours, -bound, bound))


@pytest.mark.parametrize("options", [FIXED, ADAPTIVE], ids=["rk4", "dopri5"])
@pytest.mark.parametrize("name", ["table", "pd", "torque"])
def test_runs_in_c_are_those_of_the_loop_in_python(
    flown: Run, laws: dict[str, Any], name: str, options: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Steps chosen in C from efforts computed in C have the bits of steps chosen in Python."""
    ours = flown(laws[name], **options)
    monkeypatch.setattr(stepping.Stepper, "_in_c", lambda self, state: None)
    others = [flown(laws[name], **options)]
    if name != "torque":  # in Python its inverse model is the general path's
        others.append(flown(lambda t, q, v: laws[name](t, q, v), **options))
    assert ours.status == "finished"
    for other in others:
        assert ours.counters == other.counters
        same_bits(levels(ours), levels(other))


def test_computed_torque_in_c_moves_the_robot_as_that_in_python(flown: Run, laws: dict[str, Any]) -> None:
    ours, theirs = (flown(law, end=3e-3) for law in (laws["torque"], lambda *x: laws["torque"](*x)))
    close_to(levels(ours), levels(theirs), SOLVED)


@pytest.mark.parametrize("options", [FIXED, ADAPTIVE], ids=["rk4", "dopri5"])
def test_an_interrupt_keeps_the_steps_before_it_and_goes_on_to_the_same_bits(
    flown: Run, laws: dict[str, Any], options: Any
) -> None:
    whole = flown(laws["pd"], **options)
    heard: list[float] = []

    def stop(t: float, end: float) -> None:
        heard.append(t)
        if len(heard) == 7:
            raise KeyboardInterrupt

    part = flown(laws["pd"], progress=stop, **options)
    assert part.status == "interrupted"
    np.testing.assert_array_equal(heard, whole.t[1:8])
    np.testing.assert_array_equal(part.t, whole.t[:8])
    rest = flown(laws["pd"], resume=part, **options)
    assert rest.counters == whole.counters
    np.testing.assert_array_equal(rest.q, whole.q)


@pytest.mark.parametrize("error", [KeyboardInterrupt, ZeroDivisionError, hybridyn.TrajectoryError])
def test_errors_of_a_law_in_python_are_raised_where_they_occur(flown: Run, error: type[Exception]) -> None:
    def law(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        if t > 0.0205:
            raise error("no effort")
        return np.zeros(2)

    if error is KeyboardInterrupt:
        part = flown(law)
        assert (part.status, part.counters.steps) == ("interrupted", 20)
        return
    refused(lambda: flown(law), error, "")


@pytest.mark.parametrize("wrong", [np.zeros(3), np.array([np.nan, 0.0])])
def test_wrong_efforts_of_a_law_in_python_are_refused(flown: Run, wrong: np.ndarray) -> None:
    refused(
        lambda: flown(lambda t, q, v: np.zeros(2) if t < 0.0205 else wrong),
        hybridyn.TrajectoryError,
        "expected 2 finite numbers",
    )


def test_a_law_in_python_may_keep_what_it_receives_and_may_simulate(flown: Run) -> None:
    kept: list[tuple[np.ndarray, np.ndarray]] = []
    inner: list[SimulationResult] = []

    def law(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        if len(kept) == 11:
            inner.append(flown(np.array([1.0, 2.0])))
        kept.append((q, v))
        return np.ones(2)

    run, quiet = flown(law), flown(np.ones(2))
    np.testing.assert_array_equal(run.q, quiet.q)
    np.testing.assert_array_equal(inner[0].q, flown(np.array([1.0, 2.0])).q)
    assert len({q.tobytes() for q, _ in kept}) > 100


def test_a_prescribed_motion_on_the_compiled_path(
    model: hybridyn.CompiledRobot, reference: Reference
) -> None:
    times = np.linspace(0.0, 0.1, 12)
    given = model.robot, reference, times, model.effects, model.robot.home
    ours, theirs = follow_motion(*given, model), follow_motion(*given)
    close_to(levels(ours)[1:5], levels(theirs)[1:5], SOLVED, 1.0)


@pytest.mark.slow
@pytest.mark.parametrize("options", [{"motors": [LEFT]}, {"base": "floating"}])
def test_computed_torque_with_free_joints_is_that_in_python(options: dict[str, Any]) -> None:
    """The direct model inverted for the motors' accelerations, against the recursion for the others."""
    robot = hybridyn.load("five_bar", **options)
    assert closing_of_motors(robot) is None
    limits = Limits(dict.fromkeys(robot.motors, LIMIT))  # which the efforts keep, not the models
    model, t = hybridyn.compile(robot, ["default", limits]), np.linspace(0.0, 0.3, 7)
    x = {joint: (0.1 * np.sin(t + k), np.cos(9 * t + k), 0 * t) for k, joint in enumerate([LEFT, RIGHT])}
    q, v, _ = hybridyn.assemble(robot, motors=x)
    if robot.base == "floating":
        v[:, :6] = np.linspace(-1.0, 1.0, 42).reshape(7, 6)
    points = [RestPosture(0.0, {}, {}), RestPosture(0.3, {LEFT: 0.01}, {})]
    law = controllers.ComputedTorque(robot, from_points(robot, points, robot.home), 900.0, 60.0)
    ours = model.library.steps.efforts(law.in_c(model), t, q, v)
    theirs = np.array([law(*state) for state in zip(t, q, v, strict=True)])
    close_to([ours], [theirs], SOLVED)


def test_motors_that_move_the_same_are_left_to_python(
    model: hybridyn.CompiledRobot, reference: Reference
) -> None:
    @ctypes.CFUNCTYPE(ctypes.c_int, *[ctypes.POINTER(ctypes.c_void_p)] * 2)
    def together(given: Any, out: Any) -> int:
        """Accelerate all joints by the sum of the efforts."""
        tau = np.ctypeslib.as_array(ctypes.cast(given[2], ctypes.POINTER(ctypes.c_double)), (2,))
        np.ctypeslib.as_array(ctypes.cast(out, ctypes.POINTER(ctypes.c_double)), (4,))[:] = tau.sum() / 3
        return 0

    at, gains = ctypes.cast(together, ctypes.c_void_p).value or 0, (np.ones(2), np.ones(2))
    law = Law.tracking(reference.pieces, MotorAxes.of(model.robot), gains, {"ddm": at})
    assert model.library.steps.efforts(law, np.zeros(1), model.robot.home[None], np.zeros((1, 4))) is None


def test_computed_torque_that_stays_in_python(model: hybridyn.CompiledRobot, laws: dict[str, Any]) -> None:
    other = hybridyn.load("five_bar")
    law = controllers.ComputedTorque(other, laws["torque"]._reference, 1.0, 1.0)
    assert law.in_c(model) is None  # of another robot


def test_steps_of_the_general_path_are_counted(
    flown: Run, model: hybridyn.CompiledRobot, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = model.recomputed
    flown(np.ones(2), end=5e-3)
    assert model.recomputed == before
    monkeypatch.setattr(Explicit, "steps", lambda *_: None)  # as near a singularity
    flown(np.ones(2), end=5e-3)
    assert model.recomputed - before == 5 * len(RK4.b)


def test_a_step_that_c_refuses_is_not_tried_twice(
    flown: Run, model: hybridyn.CompiledRobot, monkeypatch: pytest.MonkeyPatch
) -> None:
    tried: list[float] = []
    take = Steps.take

    def refused(self: Steps, *given: Any) -> Taken:
        """Take nothing."""
        tried.append(float(given[3][0]))
        found = take(self, *given)
        empty = {name: getattr(found, name)[:0] for name in ("q", "v", "a", "pivot", "next_step", "rejected")}
        return replace(found, t=found.t[:1], **empty)

    monkeypatch.setattr(Steps, "take", refused)
    before = model.recomputed
    result = flown(np.ones(2), end=5e-3)
    assert len(tried) == result.counters.steps == 5
    assert model.recomputed - before == 5 * len(RK4.b)


def test_efforts_that_c_leaves_to_python_are_counted(
    flown: Run, model: hybridyn.CompiledRobot, laws: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    before = model.recomputed
    expected = flown(laws["torque"], end=5e-3)
    assert model.recomputed == before
    monkeypatch.setattr(Steps, "efforts", lambda *_: None)  # as near a singularity
    found = flown(laws["torque"], end=5e-3)
    assert model.recomputed - before == 1 + len(found.t)  # also the first accelerations
    assert np.allclose(found.tau, expected.tau, rtol=1e-9)
