"""Steps in time in C: the general path's motion within the method's error, on loops that stay closed."""

from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.compiled.equations.states import random_states as assembled_states
from hybridyn.compiled.programs.whole_robot import function_of, programs
from hybridyn.effects import Limits
from hybridyn.manifold.manifold import Manifold
from hybridyn.simulation import stepping
from hybridyn.simulation.result import SimulationResult
from hybridyn.structure.building import build_robot
from tests.oracle import Base
from tests.robots.mechanisms import KINDS, random_mechanism
from tests.support.comparing import close_to, same_bits
from tests.support.samples import slow

AWAY = 1e-3  # rad, module lengths: Newton is quadratic there
CLOSED = 1e-12  # residuals and slips after Newton's last step
ROUNDING = 1e-13  # of displacements and their rates
COORDINATES = 5.0  # independent joints are no tangent space: what that costs in accuracy
HALVED = 16.0  # what an error of order 4 falls by when the step is halved
LIMIT = 1e3  # N m: above what the five-bar needs
FAST = 8.0  # m/s, rad/s
FRAME: dict[str, Any] = {"method": "rk4", "step": 1e-3}


def robot_of(kind: str, base: Base) -> hybridyn.HybridRobot:
    return build_robot(random_mechanism(1, kind=kind, base=base), base=base)


@pytest.mark.parametrize(
    ("kind", "base"),
    [
        (kind, base) if (kind, base) == ("serial_all", "floating") else slow(kind, base)
        for kind in sorted(KINDS)
        for base in ("fixed", "moving", "floating")
    ],
)
def test_newton_steps_close_the_loops(kind: str, base: Base) -> None:
    """Newton's steps away from an assembled posture; what is off is in units of what may be."""
    robot = robot_of(kind, base)
    program = programs(robot, models=("lift",)).get("lift")
    if program is None:
        assert robot.base == "moving" or any(m.mechanism.rounding > CLOSED for m in robot.modules)
        return
    function, manifold = function_of(program), Manifold(robot)
    rng = np.random.default_rng(0)
    q_0, v, _, _ = (x[0] for x in assembled_states(robot, 1))
    xi = AWAY * manifold.unit * rng.normal(size=robot.nv)
    for _ in range(6):
        before = xi
        q, xi, rates, pulled, _, _, pivot, _, _ = (np.array(x).ravel() for x in function(q_0, before, v))
    retraction, speed = manifold.retraction, np.abs(v).max()
    assert pivot.min() > 1e-3
    off = [
        manifold.residual(q)[0] / CLOSED,
        manifold.opening(q, rates)[0] / CLOSED,
        np.abs(retraction.move(q_0, xi) - q).max() / ROUNDING,
        np.abs(retraction.pull(before, rates) - pulled).max() / speed / ROUNDING,
    ]
    assert max(off) <= 1.0


@pytest.fixture(scope="module")
def five_bar() -> hybridyn.CompiledRobot:
    robot = hybridyn.load("five_bar")
    limits = Limits(dict.fromkeys(robot.motors, LIMIT))
    return hybridyn.compile(robot, effects=["default", limits])


@pytest.fixture(scope="module")
def gough() -> hybridyn.CompiledRobot:
    return hybridyn.compile(robot_of("gough", "floating"))


def pushed(model: hybridyn.CompiledRobot, seed: int = 3) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a fast state, and efforts that hold a slow one but for a bit."""
    q, v, _, _ = (x[0] for x in assembled_states(model.robot, 1, seed))
    v *= FAST / np.abs(v).max()
    still = np.zeros_like(v)
    tau = hybridyn.idm(model.robot, q, still, still) if model.robot.base == "fixed" else 0.1
    return q, v, np.full(len(model.robot.motors), tau) * 1.1


def flown(
    model: hybridyn.CompiledRobot, compiled: bool = True, end: float = 0.02, **options: Any
) -> SimulationResult:
    q, v, tau = pushed(model)
    given = FRAME | {"effort": tau, "effects": model.effects} | options
    return hybridyn.simulate(model.robot, q, v, (0, end), compiled=model if compiled else None, **given)


@pytest.mark.parametrize("name", ["five_bar", "gough"])
def test_steps_have_order_four_and_keep_the_loops_closed(name: str, request: pytest.FixtureRequest) -> None:
    model = request.getfixturevalue(name)
    exact = flown(model, compiled=False, method="dopri5", rtol=1e-12, atol=1e-14)
    steps = (4e-3, 2e-3)
    runs = [flown(model, step=h) for h in steps]
    errors = np.array([np.abs(run.v[-1] - exact.v[-1]).max() for run in runs])
    assert (errors[:-1] / errors[1:] > 0.75 * HALVED).all()
    others = flown(model, compiled=False, step=steps[0])
    assert errors[0] < COORDINATES * np.abs(others.v[-1] - exact.v[-1]).max()
    for run in runs:
        assert run.status == "finished"
        assert run.residual.max() < CLOSED
        close_to(run.residual, hybridyn.closure_residual(model.robot, run.q), 1e-15, 1.0)
        close_to(run.a, hybridyn.ddm(model.robot, run.q, run.v, run.tau, effects=model.effects), 1e-10)
    assert runs[0].counters == others.counters


@pytest.mark.parametrize("method", ["rk4", "dopri5"])
def test_a_law_of_efforts_goes_the_way_of_constant_ones(
    five_bar: hybridyn.CompiledRobot, method: str
) -> None:
    _, _, tau = pushed(five_bar)
    law, constant = (flown(five_bar, effort=x, method=method) for x in (lambda t, q, v: tau, tau))
    agree = ROUNDING if method == "rk4" else 1e-8  # rounding of small error estimates chooses other steps
    np.testing.assert_allclose(law.q, constant.q, rtol=0, atol=agree)
    assert law.counters == constant.counters


@pytest.mark.slow
def test_adaptive_steps_meet_their_tolerance(gough: hybridyn.CompiledRobot) -> None:
    exact = flown(gough, compiled=False, method="dopri5", rtol=1e-12, atol=1e-14)
    ours = flown(gough, method="dopri5", rtol=1e-8, atol=1e-10)
    assert np.abs(ours.q[-1] - exact.q[-1]).max() < 1e-7
    assert 1 < ours.counters.steps < exact.counters.steps


@pytest.mark.slow
def test_implicit_steps_are_those_of_the_general_path_but_for_its_error(
    gough: hybridyn.CompiledRobot,
) -> None:
    exact = flown(gough, compiled=False, method="dopri5", rtol=1e-12, atol=1e-14)
    ours, theirs = (flown(gough, x, method="implicit", step=5e-3) for x in (True, False))
    errors = [np.abs(run.v[-1] - exact.v[-1]).max() for run in (ours, theirs)]
    assert errors[0] < COORDINATES * errors[1]
    assert ours.residual.max() < CLOSED
    assert gough.recomputed == 0


def test_the_bits_do_not_depend_on_how_many_steps_are_taken_in_one_go(
    five_bar: hybridyn.CompiledRobot, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = flown(five_bar)
    monkeypatch.setattr(stepping, "AHEAD", 3)
    parts = flown(five_bar)
    half = flown(five_bar, end=0.01)
    _, _, tau = pushed(five_bar)
    rest = hybridyn.simulate(
        five_bar.robot, None, None, (0, 0.02), compiled=five_bar, resume=half, effects=five_bar.effects,
        effort=tau, **FRAME,
    )  # fmt: skip
    for other in (parts, rest):
        same_bits((other.q, other.energy), (whole.q, whole.energy))
    assert whole.counters == rest.counters


def test_events_outputs_and_backward_runs(five_bar: hybridyn.CompiledRobot) -> None:
    times = [0.0, 0.00312, 0.0111]
    sampled = flown(five_bar, output_times=times)
    general = flown(five_bar, compiled=False, output_times=times)
    np.testing.assert_allclose(sampled.q, general.q, rtol=0, atol=1e-9)
    assert sampled.residual.max() < CLOSED
    last = sampled.q[-1][0]
    event = hybridyn.Event("there", lambda t, q, v: q[0] - last, terminal=True)
    stopped = flown(five_bar, events=[event])
    assert (stopped.status, stopped.events[0].t) == ("event", pytest.approx(times[-1], abs=1e-9))
    whole = flown(five_bar)
    _, _, tau = pushed(five_bar)
    back = hybridyn.simulate(
        five_bar.robot, whole.q[-1], whole.v[-1], (0.02, 0), compiled=five_bar, effort=tau,
        effects=five_bar.effects, **FRAME,
    )  # fmt: skip
    np.testing.assert_allclose(back.q[-1], whole.q[0], rtol=0, atol=1e-7)


def test_limits_hold_in_steps_too(five_bar: hybridyn.CompiledRobot) -> None:
    many = 1e6 * np.ones(len(five_bar.robot.motors))
    ours, theirs = (flown(five_bar, compiled=x, end=3e-3, effort=many) for x in (True, False))
    assert (ours.tau == theirs.tau).all()
    np.testing.assert_allclose(ours.q, theirs.q, rtol=0, atol=1e-6)


def test_a_way_out_of_reach_ends_as_on_the_general_path(five_bar: hybridyn.CompiledRobot) -> None:
    """The general path takes over where dependent joints lose hold, and says what it says."""
    q, v, _ = pushed(five_bar)
    fast = 1000 * v / np.abs(v).max()
    ends = []
    for model in (five_bar, None):
        run = hybridyn.simulate(
            five_bar.robot, q, fast, (0, 0.1), compiled=model, effects=five_bar.effects, **FRAME
        )
        ends.append(run.status)
    assert ends == ["unreachable", "unreachable"]
