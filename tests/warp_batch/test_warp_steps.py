"""Closed steps of a batch are those of `simulate`, under each law."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.scenes.controllers import ComputedTorque, Pd
from hybridyn.scenes.references import MotorAxes
from hybridyn.warp_batch.drawing import Draw
from hybridyn.warp_batch.native_models import LAWS
from tests.robots.shipped import ROBOTS
from tests.support.extras import needs
from tests.support.samples import slow

wp = needs("gpu")
wp.config.log_level = wp.LOG_WARNING

SAMPLES, STEPS, H = 3, 5, 2e-3
#: Both take the same steps in the same coordinates; what is left is rounding through five steps.
SAME = 1e-10
#: Motors of the five-bar, from home, where its closures are nearly singular [rad].
NEAR_SINGULAR = [-1.09136963, 0.49274858]


def start(robot: hybridyn.HybridRobot) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return closed states near home, and what the law reads."""
    rng = np.random.default_rng(0)
    position = np.tile(MotorAxes.of(robot).positions(robot.home), (SAMPLES, 1))
    position += 0.02 * min(1.0, robot.modules[0].mechanism.length) * rng.normal(size=position.shape)
    q, v, _, guard = hybridyn.warp(robot, device="cpu").close(position, 0.1 * rng.normal(size=position.shape))
    assert (guard <= 1).all()
    return q, v, position


@pytest.mark.parametrize("dtype", ["float64", slow("float32")])
@pytest.mark.parametrize(
    ("name", "law"),
    [
        ("five_bar", "torque"), *(slow("five_bar", law) for law in ("constant", "table", "pd")),
        *(slow(name, law) for name in ROBOTS if name != "five_bar" for law in LAWS),
    ],
)  # fmt: skip
def test_steps_are_those_of_simulate(name: str, law: str, dtype: str) -> None:
    robot = hybridyn.load(name)
    batch, compiled = hybridyn.warp(robot, dtype=dtype, device="cpu"), hybridyn.compile(robot)
    q, v, position = start(robot)
    rng = np.random.default_rng(1)
    shape = position.shape
    weight, _ = hybridyn.warp(robot, device="cpu").idm(q, 0 * v, 0 * v)
    ones = {"tau": weight, "tau_rate": weight, "tau_bend": rng.normal(size=shape) * weight}
    ones |= {
        "position": position + 0.01,
        "rate": rng.normal(size=shape),
        "acceleration": rng.normal(size=shape),
    }
    ones |= {"kp": np.full(shape, 40.0), "kd": np.full(shape, 4.0)}
    reads = {key: ones[key] for key in LAWS[law]}
    *found, guard = batch.step(q, v, H, STEPS, law=law, **reads)
    assert (guard <= 1).all()
    within = SAME if dtype == "float64" else 1e-3
    assert hybridyn.closure_residual(robot, found[0].astype(float)).max() < (
        1e-12 if dtype == "float64" else 1e-5
    )
    for t in range(SAMPLES):
        effort = effort_of(law, robot, {key: x[t] for key, x in reads.items()})
        run = hybridyn.simulate(
            robot, q[t], v[t], (0.0, H * STEPS), effort=effort, method="rk4", step=H, compiled=compiled
        )
        end = run.q[-1], run.v[-1], run.a[-1]
        rounding = 0.0
        if dtype == "float32":  # each of the four stages of a step has that of one call
            single = hybridyn.compile(robot, dtype=dtype).ddm(*end[:2], compiled.idm(*end))
            rounding = 4 * np.abs(single - end[2]).max()
        for one, other, more in zip(found, end, (0.0, 0.0, rounding), strict=True):
            assert np.abs(one[t] - other).max() <= within * max(np.abs(other).max(), 1.0) + more


@pytest.mark.parametrize("dtype", ["float64", slow("float32")])
def test_steps_in_doubt_are_those_of_the_general_path(dtype: str) -> None:
    robot = hybridyn.load("five_bar")
    batch = hybridyn.warp(robot, dtype=dtype, device="cpu")
    exact = hybridyn.warp(robot, device="cpu")
    positions = MotorAxes.of(robot).positions(robot.home) + np.array([[0.0, 0.0], NEAR_SINGULAR])
    q, v, _, guard = exact.close(positions, [[0.1, -0.1]] * 2)
    assert (guard <= 1).all()
    *found, guard = batch.step(q, v, H, STEPS, tau=1.0, fallback=True)
    assert (guard <= 1).tolist() == [True, False]
    assert batch.failed == {"step_constant": 1}
    run = hybridyn.simulate(
        robot, q[1], v[1], (0.0, H * STEPS), effort=np.ones(2), method="rk4", step=H,
    )  # fmt: skip
    for one, other in zip(found, (run.q, run.v, run.a), strict=True):
        np.testing.assert_allclose(one[1], other[-1], rtol=1e-10 if dtype == "float64" else 1e-3)
    if dtype == "float64":
        v[1] *= 1e9
        with pytest.raises(hybridyn.HybridynError):
            batch.step(q, v, H, tau=0.0, fallback=True)


@pytest.mark.parametrize(("name", "count"), [("five_bar", 40), slow("gough_stewart", 60), slow("lx4", 40)])
def test_states_that_are_drawn_can_be_stepped_from(
    name: str, count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    if name == "five_bar":  # its own limits keep it away from singularities
        limits = Draw._limits
        monkeypatch.setattr(Draw, "_limits", lambda self: widened(limits(self)))
    batch = hybridyn.warp(hybridyn.load(name), device="cpu")
    q, v, _, failed = batch.random_states(count, seed=0)
    *_, guard = batch.step(q, v, 1e-4, tau=0.0)
    assert (guard.numpy() <= 0.6).all()  # drawn at 1/2; the pivots change by little in a short step
    loose = Draw(batch.robot, batch.made("close"), SimpleNamespace(function=any_posture), batch._arrays)  # type: ignore[arg-type]
    assert failed > loose.states(count, 0, 64)[3]


def widened(limits: list[np.ndarray]) -> list[np.ndarray]:
    """Return the limits of draws without those of positions, the motors' by a radian wider."""
    home, low, high, speed, low_q, high_q, fastest = limits
    return [home, low - 1.0, high + 1.0, speed, low_q - np.inf, high_q + np.inf, fastest]


@wp.func
def any_posture(
    q: wp.array(dtype=wp.float64), v: wp.array(dtype=wp.float64),
):  # type: ignore[no-untyped-def] # fmt: skip
    return wp.float64(0.0)


@pytest.mark.parametrize("law", LAWS)
def test_laws_of_the_general_path_are_those_of_the_device(law: str) -> None:
    robot = hybridyn.load("five_bar")
    batch = hybridyn.warp(robot, device="cpu")
    q, v, position = start(robot)
    reads = {"tau": 2.0, "tau_rate": 30.0, "tau_bend": -4e3, "position": position + 0.01}
    reads |= {"rate": 0.3, "acceleration": 5.0, "kp": 40.0, "kd": 4.0}
    chosen = {name: np.broadcast_to(reads[name], position.shape) for name in LAWS[law]}
    right = batch.step(q, v, H, STEPS, law=law, **chosen)
    clock = np.tile([H, STEPS], (SAMPLES, 1))
    found = batch._general.step(law, np.array([2, 0]), {"q": q, "v": v, "clock": clock} | chosen)
    for one, other in zip(found, right[:3], strict=True):  # the coordinates differ: the method's error
        np.testing.assert_allclose(one, other[[2, 0]], rtol=1e-6, atol=1e-6 * np.abs(other).max())


def effort_of(law: str, robot: hybridyn.HybridRobot, reads: dict[str, np.ndarray]) -> Callable[..., Any]:
    """Return a law as `simulate` takes it."""
    x = [reads[key] for key in LAWS[law][:3]]
    if law == "constant":
        return lambda t, q, v: x[0]
    at: Callable[[float], Any] = lambda t: (x[0] + t * x[1] + t * t / 2 * x[2], x[1] + t * x[2], x[2])  # noqa: E731
    if law == "table":
        return lambda t, q, v: at(t)[0]
    reference: Any = SimpleNamespace(at=at)
    gains = (dict(zip(robot.motors, reads[key], strict=True)) for key in ("kp", "kd"))
    controller = {"pd": Pd, "torque": ComputedTorque}[law](robot, reference, *gains)
    return lambda t, q, v: controller(t, q, v)  # in Python: a reference in C has pieces


def test_steps_that_cannot_be_taken_are_nan_and_laws_that_are_not_there_are_refused() -> None:
    robot = hybridyn.load("five_bar")
    batch = hybridyn.warp(robot, device="cpu")
    q, v, _ = start(robot)
    v[1] *= 1e6
    moved, *_, guard = batch.step(q, v, H, tau=0.0)
    assert np.isnan(moved[1]).all()
    assert np.isfinite(moved[[0, 2]]).all()
    assert guard[1] == np.inf
    assert batch.failed == {"step_constant": 1}
    with pytest.raises(hybridyn.ModelError, match=r"no law 'torgue' .did you mean 'torque'"):
        batch.step(q, v, H, law="torgue")
    with pytest.raises(hybridyn.ModelError, match=r"the law 'pd' reads position, rate, .* not 'tau'"):
        batch.step(q, v, H, law="pd", tau=0.0)
    sized = hybridyn.warp(robot, parameters=["position:m1_left_elbow"], device="cpu")
    with pytest.raises(hybridyn.ModelError, match="its parameters change the loops"):
        sized.step(q, v, H)
    with pytest.raises(hybridyn.ModelError, match="a batch with parameters draws no states"):
        sized.random_states(3)
