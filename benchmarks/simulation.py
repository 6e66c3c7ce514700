"""Time integration of motions and of scenes: error of the final state against time.

Motions are judged by their energy and their closures, too: motors push with constant efforts, so that the
energy less their work stays. The long motion is that of a robot that hangs: it swings within reach for as
long as one likes, where one that stands on constant efforts falls. Scenes take processor time per simulated
second:

- The flyball governor's scene: stiff springs and dampers, outputs at 100 Hz.
- An excavator whose cylinders follow a reference by computed torque. It starts on the reference, so that the
  exact motion is the reference itself: MuJoCo, which has no inverse model of the closed robot, receives the
  efforts of the reference, and proportional-derivative control with the same frequencies about it.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from itertools import chain
from typing import Any

import numpy as np

import hybridyn
from benchmarks.cases import GOLDEN_ANGLE, ROOT, case_of
from benchmarks.flights import Judge, Run, Start, Steps, adaptive, fly, in_mujoco
from benchmarks.peers import rk4
from benchmarks.peers.ours import COMPILED, GENERAL, compiled
from benchmarks.results import Row
from hybridyn.scenes.controllers import ComputedTorque
from hybridyn.scenes.references import Reference, RestPosture, from_points
from hybridyn.scenes.stage import stage
from hybridyn.studies.compare.engines.mujoco_engine import MujocoEngine
from hybridyn.studies.compare.methods import written

#: Error of the final state beyond which it is said to be lost.
GIVEN_UP = 10.0
#: Step of the RK4 that the reference is held against, in those of the finest run.
OTHER = 0.5
#: Most iterations of MuJoCo's solver.
ITERATIONS = 20


#: Robot, rate of its motors at the start [rad/s, m/s], whether they push with what holds home at rest (or not
#: at all), and duration [s].
Motion = tuple[str, float, bool, float]
LONG = "lx4, hanging, 1 s"
MOTIONS: dict[str, Motion] = {
    "five_bar, let go, 1 s": ("five_bar", 0.5, False, 1.0),
    "lx4, pushed off, 0.2 s": ("lx4", 0.1, True, 0.2),
    LONG: ("hanging_lx4", 0.1, True, 1.0),
}


_FINE = (1e-2, 5e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4)
#: What is flown: steps [s] of RK4 on the general path, on the compiled model, and on Pinocchio's solvers;
#: those that are held by projection; relative tolerances on the compiled model and on the general path; steps
#: of the conserving and of the implicit method, and of MuJoCo.
STEPS: Steps = {
    "rk4": (1e-2, 5e-3, 2e-3), "compiled": _FINE, "peers": _FINE, "projected": (1e-2, 5e-3, 2e-3, 1e-3),
    "rtol": (1e-3, 1e-5, 1e-7, 1e-9, 1e-11), "general": (1e-3, 1e-5, 1e-7, 1e-9),
    "conserving": (1e-2, 5e-3, 2e-3, 1e-3), "implicit": (1e-2, 5e-3),
    "mujoco": (2e-3, 1e-3, 5e-4, 2e-4, 1e-4, 2e-5),
}  # fmt: skip

GOVERNOR, EXCAVATOR = "flyball governor", "excavator, computed torque"
SCENES = (GOVERNOR, EXCAVATOR)
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


#: What is run: relative tolerances of "dopri5" with the law in C, steps of "rk4" [s], tolerances with the law
#: in Python, steps of MuJoCo [s].
SCENE_STEPS: Steps = {
    "rtol": (1e-5, 1e-7, 1e-9), "rk4": (5e-4, 1e-4), "python": (1e-5,),
    "mujoco": (1e-3, 5e-4, 2e-4, 1e-4, 5e-5, 2e-5),
}  # fmt: skip
#: Simulated time [s].
DURATION = 1.5


def start(motion: Motion, part: float) -> Start:
    """Load a robot and set it off."""
    name, speed, held, duration = motion
    robot = case_of(name).load()
    motors = {}
    for k, name in enumerate(robot.motors):
        home = float(robot.home[robot.q_slices[robot.joint_index[name]].start])
        motors[name] = (home, speed * math.cos(GOLDEN_ANGLE * k), 0.0)
    q, v, _ = hybridyn.assemble(robot, motors=motors, guess=robot.home)
    still = np.zeros(robot.nv)
    tau = hybridyn.idm(robot, q, still, still) if held else np.zeros(len(robot.motors))
    return Start(robot, q, v, duration * part, tau)


def own_flights(at: Start, steps: Steps, model: dict[str, Any]) -> Iterator[Run]:
    """Yield hybridyn's runs, on the general path and with a compiled model as an option."""
    for engine, lengths, more in ((GENERAL, steps["rk4"], {}), (COMPILED, steps["compiled"], model)):
        for h in lengths:
            options = {"method": "rk4", "step": h} | more
            yield at.run(f"{engine}, rk4, closed in stages", f"step {h:g}", options)
    for engine, tolerances in ((GENERAL, steps["general"]), (COMPILED, steps["rtol"])):
        for rtol in tolerances:
            options = adaptive(rtol) | (model if engine == COMPILED else {})
            yield at.run(f"{engine}, dopri5", f"rtol {rtol:g}", options)
    fixed = [("implicit", h) for h in steps["implicit"]]
    if not at.effort.any():  # it conserves where nothing pushes
        fixed += [("conserving", h) for h in steps["conserving"]]
    for method, h in fixed:
        yield at.run(f"{GENERAL}, {method}", f"step {h:g}", {"method": method, "step": h})


def peer_flights(at: Start, steps: Steps) -> Iterator[Run]:
    """Yield the others' runs."""
    for solver in rk4.SOLVERS:
        for hold in rk4.HOLDS if solver == "constraintDynamics" else rk4.HOLDS[:1]:
            for h in steps["projected"] if hold == "projection" else steps["peers"]:
                prepare = partial(rk4.prepare, at.robot, at.q, at.v, at.effort, at.duration, h, solver, hold)
                yield Run(f"rk4 on {solver}, held by {hold}", f"step {h:g}", prepare)
    for integrator in ("Euler", "RK4"):
        for h in steps["mujoco"]:
            for constant in sorted({0.02, 2 * h}):
                setting = written({"step": h, "solref": constant})
                yield Run(
                    f"MuJoCo, {integrator}", setting, in_mujoco(at, integrator, h, constant, ITERATIONS)
                )


def measure(case: str, steps: Steps, part: float = 1.0) -> list[Row]:
    """Fly every method at every setting.

    Args:
        case: A motion.
        steps: What differs from `STEPS`.
        part: Of the motion's duration that is flown.
    """
    steps, at = {**STEPS, **steps}, start(MOTIONS[case], part)
    replace(at, duration=2e-3).simulate({"method": "rk4", "step": 1e-3})  # everything is imported
    model = {"compiled": compiled(at.robot)}
    judge = Judge(at, model)
    check = judge.check(case, OTHER * min(steps["compiled"]), "at half the finest step", model)
    runs = chain(own_flights(at, steps, model), peer_flights(at, steps))
    return [check, *fly(case, runs, judge, time.perf_counter, GIVEN_UP, conserved=True)]


def scene(case: str, duration: float) -> tuple[Start, Any, Reference | None]:
    """Load a scene: its start, the compiled model, and the motors' reference."""
    if case == GOVERNOR:
        ready = stage(ROOT / "models/benchmarks/flyball_governor/settle.toml")
        start = Start(ready.robot, ready.q0, ready.v0, duration, None, ready.effects, OUTPUTS)
        return start, hybridyn.compile(ready.robot, ready.effects, wait=True), None
    robot = hybridyn.load(ROOT / "benchmarks/robots/excavator.urdf")
    points = [
        RestPosture(0.0, {}, {}),
        *(RestPosture(MOVE * (k + 1), goal, {}) for k, goal in enumerate(GOALS)),
    ]
    reference = from_points(robot, points, robot.home)
    law = ComputedTorque(robot, reference, KP, KD)
    start = Start(robot, robot.home, np.zeros(robot.nv), duration, law, "default", OUTPUTS)
    return start, hybridyn.compile(robot, wait=True), reference


def controlled(case: str, steps: Steps | None = None, duration: float = DURATION) -> list[Row]:
    """Run every method at every setting.

    Args:
        case: A scene.
        steps: What differs from `SCENE_STEPS`.
        duration: Simulated time [s].
    """
    steps = {**SCENE_STEPS, **(steps or {})}
    at, model, reference = scene(case, duration)
    judge = Judge(at, {"compiled": model})
    check = judge.check(case, FINE, "at 20 us", {"compiled": model})
    runs = chain(own_runs(at, model, steps), mujoco_runs(at, model, reference, steps))
    return [check, *fly(case, runs, judge, time.process_time, LOST, per=duration)]


def own_runs(at: Start, model: Any, steps: Steps) -> Iterator[Run]:
    """Yield hybridyn's runs."""
    for rtol in steps["rtol"]:
        yield at.run(f"{COMPILED}, dopri5", f"rtol {rtol:g}", {"compiled": model, **adaptive(rtol)})
    for h in steps["rk4"]:
        yield at.run(f"{COMPILED}, rk4", f"step {h:g}", {"compiled": model, "method": "rk4", "step": h})
    if law := at.effort:
        slow = replace(at, effort=lambda t, q, v: law(t, q, v))
        for rtol in steps["python"]:
            name = f"{COMPILED}, law in Python, dopri5"
            yield slow.run(name, f"rtol {rtol:g}", {"compiled": model, **adaptive(rtol)})


def mujoco_runs(at: Start, model: Any, reference: Reference | None, steps: Steps) -> Iterator[Run]:
    """Yield MuJoCo's runs."""
    for integrator in ("implicitfast", "RK4"):
        for h in steps["mujoco"]:
            setting = written({"step": h, "solref": 2 * h})
            law = None if reference is None else partial(control, at, model, reference, h)
            yield Run(f"MuJoCo, {integrator}", setting, in_mujoco(at, integrator, h, 2 * h, law=law))


def control(
    at: Start, model: Any, reference: Reference, h: float, own: MujocoEngine
) -> Callable[[int], None]:
    """Prepare MuJoCo's control, in NumPy from numbers that are prepared; gives what sets it for a step.

    Efforts are those of half a step later. Gains are those of the mass that each motor moves at the start
    while the others stand.
    """
    t = h * np.arange(round(at.duration / h), dtype=float)
    x, x_dot, _ = reference.rows(t)
    tau = model.idm(*model.close(*reference.rows(t + h / 2)))
    start, unit = reference.x[0, 0], np.eye(len(at.robot.motors))
    efforts = [model.idm(*model.close(start, 0 * start, a)) for a in (0 * start, *unit)]
    size = np.diag(np.array(efforts[1:]) - efforts[0])
    kp, kd, data = KP * size, KD * size, own.data
    of_q, of_v = own.q_at[at.robot.motor_q], own.v_at[at.robot.motor_v]

    def steer(k: int) -> None:
        data.ctrl[:] = tau[k] + kp * (x[k] - data.qpos[of_q]) + kd * (x_dot[k] - data.qvel[of_v])

    return steer
