"""Scenes: processor time per simulated second against the error of the final state, also of MuJoCo.

- The flyball governor's scene: stiff springs and dampers, outputs at 100 Hz.
- An excavator whose cylinders follow a reference by computed torque. It starts on the reference, so that the
  exact motion is the reference itself: MuJoCo, which has no inverse model of the closed robot, receives the
  efforts of the reference, and proportional-derivative control with the same frequencies about it.

MuJoCo reads the robot as `hybridyn.convert` writes it.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from typing import Any

import numpy as np

import hybridyn
from benchmarks.cases import ROOT
from benchmarks.flights import Flown, Judge, Run, Start, adaptive, fly, mujocos
from benchmarks.methods import written
from benchmarks.peers.ours import COMPILED
from benchmarks.results import Row
from hybridyn.scenes.controllers import ComputedTorque
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
#: Error beyond which a run is said to be lost.
LOST = 1.0
#: Step of the RK4 that the reference is held against [s].
FINE = 2e-5
#: Rate of the outputs [Hz].
OUTPUTS = 100.0


@dataclass(frozen=True)
class Steps:
    """Which settings are run.

    Attributes:
        ours: Relative tolerances of "dopri5".
        fixed: Steps of "rk4" [s].
        python: Tolerances with the law in Python.
        mujoco: Steps of MuJoCo [s].
        duration: Simulated time [s].
    """

    ours: tuple[float, ...] = (1e-5, 1e-7, 1e-9)
    fixed: tuple[float, ...] = (5e-4, 1e-4)
    python: tuple[float, ...] = (1e-5,)
    mujoco: tuple[float, ...] = (1e-3, 5e-4, 2e-4, 1e-4, 5e-5, 2e-5)
    duration: float = 1.5


def scene(case: str, duration: float) -> tuple[Start, Any, Reference | None]:
    """Load a scene: its start, the compiled model, and the motors' reference."""
    if case == GOVERNOR:
        ready = stage(ROOT / "models/benchmarks/flyball_governor/settle.toml")
        start = Start(ready.robot, ready.q0, ready.v0, duration, None, ready.effects, OUTPUTS)
        return start, hybridyn.compile(ready.robot, ready.effects), None
    robot = hybridyn.load(ROOT / "benchmarks/robots/excavator.urdf")
    points = [Point(0.0, {}, {}), *(Point(MOVE * (k + 1), goal, {}) for k, goal in enumerate(GOALS))]
    reference = from_points(robot, points, robot.home)
    law = ComputedTorque(robot, reference, KP, KD)
    start = Start(robot, robot.home, np.zeros(robot.nv), duration, law, "default", OUTPUTS)
    return start, hybridyn.compile(robot), reference


def measure(case: str, steps: Steps) -> list[Row]:
    """Run every method at every setting."""
    at, model, reference = scene(case, steps.duration)
    judge = Judge(at, {"compiled": model})
    check = judge.check(case, FINE, "at 20 us", {"compiled": model})
    runs = chain(own_runs(at, model, steps), mujoco_runs(at, model, reference, steps))
    return [check, *fly(case, runs, judge, time.process_time, LOST, per=steps.duration)]


def own_runs(at: Start, model: Any, steps: Steps) -> Iterator[Run]:
    """Yield hybridyn's runs."""
    for rtol in steps.ours:
        yield at.run(f"{COMPILED}, dopri5", f"rtol {rtol:g}", {"compiled": model, **adaptive(rtol)})
    for h in steps.fixed:
        yield at.run(f"{COMPILED}, rk4", f"step {h:g}", {"compiled": model, "method": "rk4", "step": h})
    if law := at.effort:
        slow = replace(at, effort=lambda t, q, v: law(t, q, v))
        for rtol in steps.python:
            name = f"{COMPILED}, law in Python, dopri5"
            yield slow.run(name, f"rtol {rtol:g}", {"compiled": model, **adaptive(rtol)})


def mujoco_runs(at: Start, model: Any, reference: Reference | None, steps: Steps) -> Iterator[Run]:
    """Yield MuJoCo's runs."""
    for integrator in ("implicitfast", "RK4"):
        for h in steps.mujoco:
            setting = written({"step": h, "solref": 2 * h})
            prepare = partial(in_mujoco, at, model, reference, integrator, h)
            yield Run(f"MuJoCo, {integrator}", setting, prepare)


def in_mujoco(
    at: Start, model: Any, reference: Reference | None, integrator: str, h: float
) -> Callable[[], Flown]:
    """Prepare a run of MuJoCo; the control is computed in NumPy from numbers that are prepared.

    Raises:
        NotMeasuredError: It is not installed.
    """
    own = mujocos(at, integrator, h, 2 * h)
    count = round(at.duration / h)
    data, step = own.data, partial(own.mujoco.mj_step, own.model, own.data)

    def start() -> None:
        own.mujoco.mj_resetDataKeyframe(own.model, data, 0)
        own.place(at.q, at.v)

    def free() -> Flown:
        start()
        step(nstep=count)
        return *(x[None].copy() for x in own.state()), count  # type: ignore[return-value]

    if reference is None:
        return free
    motors = MotorAxes.of(at.robot).columns
    of_q, of_v = own.to_q[motors], own.to_v[motors]
    x, x_dot, tau, kp, kd = control(at, model, reference, np.arange(count, dtype=float) * h, h)

    def driven() -> Flown:
        start()
        for k in range(count):
            data.ctrl[:] = tau[k] + kp * (x[k] - data.qpos[of_q]) + kd * (x_dot[k] - data.qvel[of_v])
            step()
        return *(x[None].copy() for x in own.state()), count  # type: ignore[return-value]

    return driven


def control(at: Start, model: Any, reference: Reference, t: Array, h: float) -> tuple[Array, ...]:
    """Return references and efforts (half a step later), shapes (T, motors), and gains, shapes (motors,).

    Gains are those of the mass that each motor moves at the start while the others stand.
    """
    x, x_dot, _ = reference.rows(t)
    tau = model.idm(*model.close(*reference.rows(t + h / 2)))
    start, unit = reference.x[0, 0], np.eye(len(at.robot.motors))
    efforts = [model.idm(*model.close(start, 0 * start, a)) for a in (0 * start, *unit)]
    size = np.diag(np.array(efforts[1:]) - efforts[0])
    return x, x_dot, tau, KP * size, KD * size
