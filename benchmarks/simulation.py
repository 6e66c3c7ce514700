"""Time integration: error of the final state, energy drift and closure residual against time.

Motors push with constant efforts, so that the energy less their work stays. Everything is judged by the same
functions, after the clock has stopped. The long motion is that of a robot that hangs: it swings within reach
for as long as one likes, where one that stands on constant efforts falls.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

import hybridyn
from benchmarks.cases import GOLDEN_ANGLE, case_of
from benchmarks.flights import SAMPLES, Flown, Judge, Run, Start, adaptive, fly, mujocos
from benchmarks.methods import NotMeasuredError, written
from benchmarks.peers import rk4
from benchmarks.peers.ours import COMPILED, GENERAL, compiled
from benchmarks.results import Row

#: Error of the final state beyond which it is said to be lost.
GIVEN_UP = 10.0
#: Step of the RK4 that the reference is held against, in those of the finest run.
OTHER = 0.5
#: Most iterations of MuJoCo's solver.
ITERATIONS = 20


class Motion(NamedTuple):
    """What is simulated.

    Attributes:
        robot: Name of the case.
        rate: Of the motors at the start [rad/s, m/s].
        held: True where the motors push with what holds home at rest, false for no efforts.
        duration: [s].
    """

    robot: str
    rate: float
    held: bool
    duration: float


LONG = "lx4, hanging, 1 s"
MOTIONS = {
    "five_bar, let go, 1 s": Motion("five_bar", 0.5, False, 1.0),
    "lx4, pushed off, 0.2 s": Motion("lx4", 0.1, True, 0.2),
    LONG: Motion("hanging_lx4", 0.1, True, 1.0),
}


@dataclass(frozen=True)
class Steps:
    """Which settings are flown.

    Attributes:
        rk4: Steps of RK4 on the general path [s].
        compiled: Steps of RK4 on the compiled model [s].
        peers: Steps of RK4 on Pinocchio's solvers [s].
        projected: Those of them that are held by projection [s].
        rtol: Relative tolerances of the adaptive method, on the compiled model too.
        general: Those of them that are flown on the general path.
        conserving: Steps of the conserving method [s].
        implicit: Steps of the implicit method [s].
        mujoco: Steps of MuJoCo [s].
        part: Of the motion's duration that is flown.
    """

    rk4: tuple[float, ...] = (1e-2, 5e-3, 2e-3)
    compiled: tuple[float, ...] = (1e-2, 5e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4)
    peers: tuple[float, ...] = (1e-2, 5e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4)
    projected: tuple[float, ...] = (1e-2, 5e-3, 2e-3, 1e-3)
    rtol: tuple[float, ...] = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11)
    general: tuple[float, ...] = (1e-3, 1e-5, 1e-7, 1e-9)
    conserving: tuple[float, ...] = (1e-2, 5e-3, 2e-3, 1e-3)
    implicit: tuple[float, ...] = (1e-2, 5e-3)
    mujoco: tuple[float, ...] = (2e-3, 1e-3, 5e-4, 2e-4, 1e-4, 2e-5)
    part: float = 1.0


def start(motion: Motion, part: float) -> Start:
    """Load a robot and set it off."""
    robot = case_of(motion.robot).load()
    motors = {}
    for k, name in enumerate(robot.motors):
        home = float(robot.home[robot.q_slices[robot.joint_index[name]].start])
        motors[name] = (home, motion.rate * math.cos(GOLDEN_ANGLE * k), 0.0)
    q, v, _ = hybridyn.assemble(robot, motors=motors, guess=robot.home)
    still = np.zeros(robot.nv)
    tau = hybridyn.idm(robot, q, still, still) if motion.held else np.zeros(len(robot.motors))
    return Start(robot, q, v, motion.duration * part, tau)


def with_compiled(at: Start) -> dict[str, Any]:
    """Return the option of a run on the compiled model, none where nothing can be compiled here."""
    try:
        return {"compiled": compiled(at.robot)}
    except NotMeasuredError:
        return {}


def own_flights(at: Start, steps: Steps, model: dict[str, Any]) -> Iterator[Run]:
    """Yield hybridyn's runs, on the general path and with a compiled model as an option."""
    closed = {"stages": "closed in stages", "steps": "closed after steps", "never": "not closed"}
    wanted = [(GENERAL, h, projection) for projection in closed for h in steps.rk4]
    wanted += [(COMPILED, h, "stages") for h in steps.compiled]  # open postures are the general path's
    for engine, h, projection in wanted:
        options = {"method": "rk4", "step": h, "projection": projection} | (
            model if engine == COMPILED else {}
        )
        yield at.run(f"{engine}, rk4, {closed[projection]}", f"step {h:g}", options)
    for engine, tolerances in ((GENERAL, steps.general), (COMPILED, steps.rtol)):
        for rtol in tolerances:
            options = adaptive(rtol) | (model if engine == COMPILED else {})
            yield at.run(f"{engine}, dopri5", f"rtol {rtol:g}", options)
    fixed = [("implicit", h) for h in steps.implicit]
    if not at.effort.any():  # it conserves where nothing pushes
        fixed += [("conserving", h) for h in steps.conserving]
    for method, h in fixed:
        yield at.run(f"{GENERAL}, {method}", f"step {h:g}", {"method": method, "step": h})


def peer_flights(at: Start, steps: Steps) -> Iterator[Run]:
    """Yield the others' runs."""
    for solver in rk4.SOLVERS:
        for hold in rk4.HOLDS if solver == "constraintDynamics" else rk4.HOLDS[:1]:
            for h in steps.projected if hold == "projection" else steps.peers:
                prepare = partial(rk4.prepare, at.robot, at.q, at.v, at.effort, at.duration, h, solver, hold)
                yield Run(f"rk4 on {solver}, held by {hold}", f"step {h:g}", prepare)
    for integrator in ("Euler", "RK4"):
        for h in steps.mujoco:
            for constant in sorted({0.02, 2 * h}):
                setting = written({"step": h, "solref": constant})
                yield Run(f"MuJoCo, {integrator}", setting, partial(in_mujoco, at, integrator, h, constant))


def in_mujoco(at: Start, integrator: str, step: float, constant: float) -> Callable[[], Flown]:
    """Prepare a run of MuJoCo.

    Raises:
        NotMeasuredError: It is not installed, or cannot state the robot.
    """
    own = mujocos(at, integrator, step, constant, ITERATIONS)
    own.data.qfrc_applied[own.motors] = at.effort
    steps = round(at.duration / step)
    every = max(1, steps // SAMPLES)

    def run() -> Flown:
        own.place(at.q, at.v)
        states = [own.state()]
        for i in range(steps):
            own.mujoco.mj_step(own.model, own.data)
            if (i + 1) % every == 0 or i == steps - 1:
                states.append(own.state())
        return np.array([q for q, _ in states]), np.array([v for _, v in states]), steps

    return run


def measure(case: str, steps: Steps) -> list[Row]:
    """Fly every method at every setting."""
    at = start(MOTIONS[case], steps.part)
    replace(at, duration=2e-3).simulate({"method": "rk4", "step": 1e-3})  # everything is imported
    model = with_compiled(at)
    judge = Judge(at, model)
    check = judge.check(case, OTHER * min(steps.compiled), "at half the finest step", model)
    runs = chain(own_flights(at, steps, model), peer_flights(at, steps))
    return [check, *fly(case, runs, judge, time.perf_counter, GIVEN_UP, conserved=True)]
