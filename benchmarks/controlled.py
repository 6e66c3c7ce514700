"""Scenes: processor time per simulated second against the error of the final state, also of MuJoCo.

- The flyball governor's scene: stiff springs and dampers, outputs at 100 Hz.
- An excavator whose cylinders follow a reference by computed torque. It starts on the reference, so that the
  exact motion is the reference itself: MuJoCo, which has no inverse model of the closed robot, receives the
  efforts of the reference, and proportional-derivative control with the same frequencies about it.

MuJoCo reads the robot as `hybridyn.convert` writes it.
"""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import hybridyn
from benchmarks.cases import ROOT
from benchmarks.methods import NotMeasuredError, written
from benchmarks.peers import compiled
from benchmarks.results import Check, Controlled
from hybridyn import HybridRobot
from hybridyn.scenes import controllers
from hybridyn.scenes.references import MotorAxes, Point, Reference, from_points
from hybridyn.scenes.stage import stage
from hybridyn.spatial import Array

GOVERNOR, EXCAVATOR = "flyball governor", "excavator, computed torque"
CASES = (GOVERNOR, EXCAVATOR)
#: Gains of computed torque: critically damped at 30 rad/s.
KP, KD = 900.0, 60.0
#: Time of the excavator's two motions [s], and goals of its cylinders [m] and of the swing [rad].
MOVE = 2.0
GOALS = (
    {"swing": 0.5, "boom_slide": 0.15, "stick_slide": -0.3, "bucket_slide": 0.2},
    {"swing": 1.0, "boom_slide": 0.3, "stick_slide": 0.1, "bucket_slide": -0.1},
)
#: A run is made so often; the least time counts.
TIMES = 3
#: Error beyond which a run is said to be lost.
LOST = 1.0
REFERENCE: dict[str, Any] = {"method": "dopri5", "rtol": 1e-12, "atol": 1e-14}
NAME, IN_PYTHON = compiled.NAME, f"{compiled.NAME}, law in Python"


@dataclass(frozen=True)
class Steps:
    """Which settings are run.

    Attributes:
        ours: Relative tolerances of "dopri5".
        fixed: Steps of "rk4" [s].
        python: Tolerance with the law in Python, or None.
        mujoco: Steps of MuJoCo [s].
        duration: Simulated time [s].
    """

    ours: tuple[float, ...] = (1e-5, 1e-7, 1e-9)
    fixed: tuple[float, ...] = (5e-4, 1e-4)
    python: float | None = 1e-5
    mujoco: tuple[float, ...] = (1e-3, 5e-4, 2e-4, 1e-4, 5e-5, 2e-5)
    duration: float = 1.5


@dataclass(frozen=True)
class Scene:
    """A robot at the start of a scene, the effects that act, and its law of efforts."""

    robot: HybridRobot
    effects: Any
    q: Array
    v: Array
    law: controllers.ComputedTorque | None
    reference: Reference | None


def scene(case: str) -> Scene:
    """Load a scene."""
    if case == GOVERNOR:
        ready = stage(ROOT / "models/benchmarks/flyball_governor/settle.toml")
        return Scene(ready.robot, ready.effects, ready.q0, ready.v0, None, None)
    robot = hybridyn.load(ROOT / "benchmarks/robots/excavator.urdf")
    points = [Point(0.0, {}, {}), *(Point(MOVE * (k + 1), goal, {}) for k, goal in enumerate(GOALS))]
    reference = from_points(robot, points, robot.home)
    law = controllers.ComputedTorque(robot, reference, KP, KD)
    return Scene(robot, "default", robot.home, np.zeros(robot.nv), law, reference)


def measure(case: str, steps: Steps) -> list[Check | Controlled]:
    """Run every method at every setting."""
    at = scene(case)
    model = compiled.compiled(at.robot) if case == EXCAVATOR else hybridyn.compile(at.robot, at.effects)
    exact = ours(at, model, steps.duration, at.law, **REFERENCE)
    again = ours(at, model, steps.duration, at.law, method="rk4", step=2e-5)
    judge = _judge(at, exact.q[-1], exact.v[-1])
    what = "controlled: the reference (dopri5 at 1e-12) against RK4 at 20 us"
    out: list[Check | Controlled] = [Check(case, what, judge(again.q[-1], again.v[-1]), math.nan)]
    for method, setting, run in (*_own_runs(at, model, steps), *_mujoco_runs(at, model, steps)):
        times = 1 if method.startswith(IN_PYTHON) else TIMES
        try:
            q, v, seconds, count = min((run() for _ in range(times)), key=lambda found: found[2])
        except NotMeasuredError as why:
            out.append(Controlled(case, method, setting, math.nan, 0, math.nan, str(why)))
            continue
        error = judge(q, v)
        note = "" if error < LOST else "lost: it left the motion"
        out.append(Controlled(case, method, setting, seconds / steps.duration, count, error, note))
    return out


def ours(at: Scene, model: Any, duration: float, law: Any, **options: Any) -> Any:
    """Simulate a scene with outputs at 100 Hz."""
    times = np.linspace(0.0, duration, round(100 * duration) + 1)
    return hybridyn.simulate(
        at.robot, at.q, at.v, (0.0, duration), effort=law, effects=at.effects, compiled=model,
        output_times=times, **options,
    )  # fmt: skip


Ran = tuple[Array, Array, float, int]
Runs = Iterator[tuple[str, str, Callable[[], Ran]]]


def _own_runs(at: Scene, model: Any, steps: Steps) -> Runs:
    """Yield hybridyn's runs: method, setting, and what makes the run."""

    def runs(law: Any, options: dict[str, Any]) -> Callable[[], Ran]:
        def run() -> Ran:
            started = time.process_time()
            result = ours(at, model, steps.duration, law, **options)
            spent = time.process_time() - started
            if result.status != "finished":
                raise NotMeasuredError(f"the run ended: {result.status}")
            return result.q[-1], result.v[-1], spent, result.counters.steps

        return run

    for rtol in steps.ours:
        yield f"{NAME}, dopri5", f"rtol {rtol:g}", runs(at.law, _adaptive(rtol))
    for h in steps.fixed:
        yield f"{NAME}, rk4", f"step {h:g}", runs(at.law, {"method": "rk4", "step": h})
    if at.law is not None and steps.python:
        law = at.law
        yield (
            f"{IN_PYTHON}, dopri5", f"rtol {steps.python:g}",
            runs(lambda t, q, v: law(t, q, v), _adaptive(steps.python)),
        )  # fmt: skip


def _adaptive(rtol: float) -> dict[str, Any]:
    """Return the options of adaptive steps."""
    return {"method": "dopri5", "rtol": rtol, "atol": rtol / 100}


def _mujoco_runs(at: Scene, model: Any, steps: Steps) -> Runs:
    """Yield MuJoCo's runs: method, setting, and what makes the run."""
    for integrator in ("implicitfast", "RK4"):
        for h in steps.mujoco:
            setting = written({"step": h, "solref": 2 * h})

            def run(integrator: str = integrator, h: float = h) -> Ran:
                return _mujoco(at, model, integrator, h, steps.duration)

            yield f"MuJoCo, {integrator}", setting, run


def _mujoco(at: Scene, compiled_model: Any, integrator: str, h: float, duration: float) -> Ran:
    """Run MuJoCo; the control is computed in NumPy from numbers that are prepared before the clock starts.

    Raises:
        NotMeasuredError: It is not installed.
    """
    try:
        import mujoco
    except ImportError:
        raise NotMeasuredError("the package mujoco is not installed") from None
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "robot.xml"
        hybridyn.convert(at.robot, file)
        model: Any = mujoco.MjModel.from_xml_path(str(file))
    kinds = {"implicitfast": "mjINT_IMPLICITFAST", "RK4": "mjINT_RK4"}
    model.opt.integrator = getattr(mujoco.mjtIntegrator, kinds[integrator])
    model.opt.timestep = h
    model.eq_solref[:], model.eq_solimp[:, :2] = (2 * h, 1.0), 0.9999
    model.jnt_limited[:] = 0
    data: Any = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    joints = [model.joint(name) for name in at.robot.joints]
    to_q, to_v = (np.array([getattr(j, key)[0] for j in joints]) for key in ("qposadr", "dofadr"))
    data.qpos[to_q], data.qvel[to_v] = at.q, at.v
    count = round(duration / h)
    starts: Array = np.arange(count, dtype=float) * h
    control = _control(at, compiled_model, starts, h)
    motors = MotorAxes.of(at.robot).columns if control is not None else None
    position, rate, ctrl = data.qpos, data.qvel, data.ctrl
    if motors is not None:
        of_q, of_v = to_q[motors], to_v[motors]
    started = time.process_time()
    if control is None:
        mujoco.mj_step(model, data, nstep=count)
    else:
        x, x_dot, tau, kp, kd = control
        for k in range(count):
            ctrl[:] = tau[k] + kp * (x[k] - position[of_q]) + kd * (x_dot[k] - rate[of_v])
            mujoco.mj_step(model, data)
    spent = time.process_time() - started
    return data.qpos[to_q], data.qvel[to_v], spent, count


def _control(at: Scene, model: Any, t: Array, h: float) -> tuple[Array, Array, Array, Array, Array] | None:
    """Return references and efforts at times (efforts half a step later), and gains; None without a law."""
    if at.reference is None:
        return None
    x, x_dot, _ = at.reference.rows(t)
    motors = at.reference.rows(t + h / 2)
    tau = model.idm(*model.close(*motors))
    size = _masses(at, model)
    return x, x_dot, tau, KP * size, KD * size


def _masses(at: Scene, model: Any) -> Array:
    """Return the mass that each motor moves at the start while the others stand, shape (motors,)."""
    assert at.reference is not None
    start, unit = at.reference.x[0, 0], np.eye(len(at.robot.motors))
    efforts = [model.idm(*model.close(start, 0 * start, a)) for a in (0 * start, *unit)]
    return np.diag(np.array(efforts[1:]) - efforts[0])


def _judge(at: Scene, q: Array, v: Array) -> Callable[[Array, Array], float]:
    """Return what computes the error of a final state, relative to the way and to the largest rate."""
    way, rate = np.abs(q - at.q).max(), np.abs(v).max()

    def error(own_q: Array, own_v: Array) -> float:
        found = max(np.abs(own_q - q).max() / way, np.abs(own_v - v).max() / rate)
        return float(found) if np.isfinite(found) else math.inf

    return error
