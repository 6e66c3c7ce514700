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
from benchmarks.methods import NotMeasuredError, written
from benchmarks.peers import compiled, rk4
from benchmarks.peers.general import NAME as GENERAL
from benchmarks.peers.mujoco import Translated
from benchmarks.results import Check, Flight
from hybridyn import HybridRobot, HybridynError
from hybridyn.spatial import Array

#: States of a run that are judged.
SAMPLES = 200
#: Error of the final state beyond which it is said to be lost.
GIVEN_UP = 10.0
REFERENCE = {"method": "dopri5", "rtol": 1e-12, "atol": 1e-14}
AGAIN, TIMES = 6.0, 3  # a run shorter than this [s] is flown so often, whoever it is; the best time counts
#: Step of the RK4 that the reference is held against, in those of the finest run.
OTHER = 0.5

Flown = tuple[Array, Array]
#: Method, setting, and what prepares a run.
Prepared = tuple[str, str, Callable[[], Callable[[], Flown]]]


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


@dataclass(frozen=True)
class Start:
    """A robot at the start of its motion."""

    robot: HybridRobot
    q: Array
    v: Array
    tau: Array
    duration: float


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
    return Start(robot, q, v, tau, motion.duration * part)


class Judge:
    """What a run is measured by.

    Attributes:
        q, v: The final state of the reference.
        error: How far the reference is from a second method.
    """

    def __init__(self, at: Start, finest: float) -> None:
        """Fly the reference, and hold RK4 at a finer step than any other against it."""
        self._start = at
        fast = with_compiled(at)
        q, v = ours(at, {**REFERENCE, **fast})
        self.q, self.v = q[-1], v[-1]
        self._way = np.abs(self.q - at.q).max()
        self._rate = np.abs(self.v).max()
        q, v = ours(at, {"method": "rk4", "step": OTHER * finest, **fast})
        self.error = self.state(q[-1], v[-1])

    def state(self, q: Array, v: Array) -> float:
        """Return the error of a final state, relative to the way and to the largest rate."""
        with np.errstate(all="ignore"):
            error = max(np.abs(q - self.q).max() / self._way, np.abs(v - self.v).max() / self._rate)
        return float(error) if np.isfinite(error) else math.inf

    def flight(self, case: str, method: str, setting: str, seconds: float, flown: Flown) -> Flight:
        """Judge a run."""
        at = self._start
        every = max(1, len(flown[0]) // SAMPLES)
        q, v = (np.vstack([x[:-1:every], x[-1:]]) for x in flown)
        error = self.state(q[-1], v[-1])
        if not error < GIVEN_UP:
            return Flight(
                case, method, setting, seconds, error, math.nan, math.nan, "lost: it left the motion"
            )
        motors = at.robot.motor_v
        found = hybridyn.energy(at.robot, q, v)
        kept = found.total - (q - q[0])[:, motors] @ at.tau
        drift = float(np.abs(kept - kept[0]).max() / found.kinetic.max())
        closure = float(hybridyn.closure_residual(at.robot, q).max())
        return Flight(case, method, setting, seconds, error, drift, closure, "")


def ours(at: Start, options: dict[str, Any]) -> Flown:
    """Fly with `hybridyn.simulate`.

    Raises:
        NotMeasuredError: It ended early.
    """
    result = hybridyn.simulate(at.robot, at.q, at.v, (0.0, at.duration), effort=at.tau, **options)
    if result.status != "finished":
        raise NotMeasuredError(f"ended at {result.t[-1]:g} s: {result.message}")
    return result.q, result.v


def mujocos(at: Start, integrator: str, step: float, time_constant: float) -> Callable[[], Flown]:
    """Prepare a run of MuJoCo.

    Raises:
        NotMeasuredError: It is not installed, or cannot state the robot.
    """
    own = Translated(at.robot)
    kinds = own.mujoco.mjtIntegrator
    own.model.opt.integrator = {"Euler": kinds.mjINT_EULER, "RK4": kinds.mjINT_RK4}[integrator]
    own.model.opt.timestep, own.model.opt.iterations = step, 20
    own.model.eq_solref[:] = (time_constant, 1.0)
    own.stiffen(0.9999)
    own.data.qfrc_applied[own.motors] = at.tau
    steps = round(at.duration / step)
    every = max(1, steps // SAMPLES)

    def fly() -> Flown:
        own.place(at.q, at.v)
        states = [own.state()]
        for i in range(steps):
            own.mujoco.mj_step(own.model, own.data)
            if (i + 1) % every == 0 or i == steps - 1:
                states.append(own.state())
        return np.array([q for q, _ in states]), np.array([v for _, v in states])

    return fly


def with_compiled(at: Start) -> dict[str, Any]:
    """Return the option of a run on the compiled model, none where nothing can be compiled here."""
    try:
        return {"compiled": compiled.compiled(at.robot)}
    except NotMeasuredError:
        return {}


def own_flights(at: Start, steps: Steps) -> Iterator[Prepared]:
    """Return hybridyn's runs: method, setting, and what prepares it."""
    closed = {"stages": "closed in stages", "steps": "closed after steps", "never": "not closed"}
    wanted = [(GENERAL, h, projection) for projection in closed for h in steps.rk4]
    wanted += [(compiled.NAME, h, "stages") for h in steps.compiled]  # open postures are the general path's
    for engine, h, projection in wanted:
        options: dict[str, Any] = {"method": "rk4", "step": h, "projection": projection}
        yield f"{engine}, rk4, {closed[projection]}", f"step {h:g}", partial(fly_ours, at, engine, options)
    for engine, tolerances in ((GENERAL, steps.general), (compiled.NAME, steps.rtol)):
        for rtol in tolerances:
            options = {"method": "dopri5", "rtol": rtol, "atol": rtol / 100}
            yield f"{engine}, dopri5", f"rtol {rtol:g}", partial(fly_ours, at, engine, options)
    fixed = [("implicit", h) for h in steps.implicit]
    if not at.tau.any():  # it conserves where nothing pushes
        fixed += [("conserving", h) for h in steps.conserving]
    for method, h in fixed:
        options = {"method": method, "step": h}
        yield f"{GENERAL}, {method}", f"step {h:g}", partial(fly_ours, at, GENERAL, options)


def fly_ours(at: Start, engine: str, options: dict[str, Any]) -> Callable[[], Flown]:
    """Prepare a run of `hybridyn.simulate`; a model is compiled before the clock starts.

    Raises:
        NotMeasuredError: The model cannot be compiled.
    """
    if engine == compiled.NAME:
        options = {**options, "compiled": compiled.compiled(at.robot)}
    return partial(ours, at, options)


def peer_flights(at: Start, steps: Steps) -> Iterator[Prepared]:
    """Return the others' runs."""
    for solver in rk4.SOLVERS:
        for hold in rk4.HOLDS if solver == "constraintDynamics" else rk4.HOLDS[:1]:
            for h in steps.projected if hold == "projection" else steps.peers:
                prepare = partial(rk4.prepare, at.robot, at.q, at.v, at.tau, at.duration, h, solver, hold)
                yield f"rk4 on {solver}, held by {hold}", f"step {h:g}", prepare
    for integrator in ("Euler", "RK4"):
        for h in steps.mujoco:
            for constant in sorted({0.02, 2 * h}):
                setting = written({"step": h, "solref": constant})
                yield f"MuJoCo, {integrator}", setting, partial(mujocos, at, integrator, h, constant)


def measure(case: str, steps: Steps) -> list[Check | Flight]:
    """Fly every method at every setting, one after the other, short runs more than once."""
    at = start(MOTIONS[case], steps.part)
    ours(replace(at, duration=2e-3), {"method": "rk4", "step": 1e-3})  # everything is imported
    judge = Judge(at, min(steps.compiled))
    what = "simulation: the reference (dopri5 at 1e-12) against RK4 at half the finest step"
    out: list[Check | Flight] = [Check(case, what, judge.error, math.nan)]
    refused: set[str] = set()
    for method, setting, prepare in chain(own_flights(at, steps), peer_flights(at, steps)):
        if method in refused:
            continue
        try:
            fly = prepare()
            flown, seconds = _timed(fly)
            if seconds < AGAIN:
                seconds = min(seconds, *(_timed(fly)[1] for _ in range(TIMES - 1)))
        except NotMeasuredError as why:
            refused.add(method)
            out.append(Flight(case, method, "", math.nan, math.nan, math.nan, math.nan, str(why)))
            continue
        except HybridynError as why:
            note = f"refused: {str(why).splitlines()[0]}"
            out.append(Flight(case, method, setting, math.nan, math.nan, math.nan, math.nan, note))
            continue
        out.append(judge.flight(case, method, setting, seconds, flown))
    return out


def _timed(fly: Callable[[], Flown]) -> tuple[Flown, float]:
    """Return what a run gave, and its time [s]."""
    started = time.perf_counter()
    flown = fly()
    return flown, time.perf_counter() - started
