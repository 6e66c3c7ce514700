"""Time integration of anything: every method at every setting is flown, timed and judged alike."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np

import hybridyn
from benchmarks.results import CHECK, NAN, Row
from benchmarks.timing import Clock
from hybridyn import HybridRobot, HybridynError
from hybridyn.spatial import Array
from hybridyn.studies.compare.engines import mujoco_engine
from hybridyn.studies.compare.peer_engine import NotComparableError

#: States of a run that are judged.
SAMPLES = 200
#: A run shorter than this [s] is flown so often, whoever it is; the least time counts.
AGAIN, TIMES = 6.0, 3
REFERENCE: dict[str, Any] = {"method": "dopri5", "rtol": 1e-12, "atol": 1e-14}

#: Positions and rates of a run over time, and the number of steps where it is told.
Flown = tuple[Array, Array, int]
#: Steps [s] and tolerances that are flown, by method.
Steps = Mapping[str, tuple[float, ...]]


class Run(NamedTuple):
    """A method at a setting.

    Attributes:
        method, setting: Which, in words.
        prepare: Prepares it, and gives what flies it.
    """

    method: str
    setting: str
    prepare: Callable[[], Callable[[], Flown]]


@dataclass(frozen=True)
class Start:
    """A robot at the start of its motion.

    Attributes:
        robot: The robot.
        q, v: State at the start.
        duration: [s].
        effort: Efforts of the motors, or a law of them, or None.
        effects: The effects that act, as `hybridyn.simulate` takes them.
        outputs: Rate of the outputs [Hz], or None for all steps.
    """

    robot: HybridRobot
    q: Array
    v: Array
    duration: float
    effort: Any
    effects: Any = None
    outputs: float | None = None

    def simulate(self, options: dict[str, Any]) -> Flown:
        """Fly with `hybridyn.simulate`.

        Raises:
            NotComparableError: It ended early.
        """
        if self.outputs is not None:
            count = round(self.outputs * self.duration) + 1
            options = {"output_times": np.linspace(0.0, self.duration, count), **options}
        span = (0.0, self.duration)
        options = {"effort": self.effort, "effects": self.effects, **options}
        result = hybridyn.simulate(self.robot, self.q, self.v, span, **options)
        if result.status != "finished":
            raise NotComparableError(f"ended at {result.t[-1]:g} s: {result.message}")
        return result.q, result.v, result.counters.steps

    def run(self, method: str, setting: str, options: dict[str, Any]) -> Run:
        """Return a run of `hybridyn.simulate` with some options."""
        return Run(method, setting, lambda: partial(self.simulate, options))


def adaptive(rtol: float) -> dict[str, Any]:
    """Return the options of adaptive steps."""
    return {"method": "dopri5", "rtol": rtol, "atol": rtol / 100}


class Judge:
    """What a run is measured by.

    Attributes:
        q, v: The final state of the reference.
    """

    def __init__(self, at: Start, options: dict[str, Any]) -> None:
        """Fly the reference, with some options."""
        self._start, (q, v, _) = at, at.simulate({**REFERENCE, **options})
        self.q, self.v = q[-1], v[-1]
        self._way, self._rate = np.abs(self.q - at.q).max(), np.abs(self.v).max()

    def check(self, case: str, step: float, what: str, options: dict[str, Any]) -> Row:
        """Return how far the reference is from RK4."""
        q, v, _ = self._start.simulate({"method": "rk4", "step": step, **options})
        said = f"the reference (dopri5 at 1e-12) against RK4 {what}"
        return Row(case, CHECK, setting=said, error=self.error(q[-1], v[-1]))

    def error(self, q: Array, v: Array) -> float:
        """Return the error of a final state, relative to the way and to the largest rate."""
        with np.errstate(all="ignore"):
            error = max(np.abs(q - self.q).max() / self._way, np.abs(v - self.v).max() / self._rate)
        return float(error) if np.isfinite(error) else math.inf

    def kept(self, q: Array, v: Array) -> tuple[float, float]:
        """Return the change of the energy under constant efforts, and the largest closure residual."""
        at, every = self._start, max(1, len(q) // SAMPLES)
        q, v = (np.vstack([x[:-1:every], x[-1:]]) for x in (q, v))
        found = hybridyn.energy(at.robot, q, v)
        energy = found.total - (q - q[0])[:, at.robot.motor_v] @ at.effort
        drift = float(np.abs(energy - energy[0]).max() / found.kinetic.max())
        return drift, float(hybridyn.closure_residual(at.robot, q).max())


def fly(
    case: str, runs: Iterable[Run], judge: Judge, clock: Clock, lost: float, *, per: float = 1.0,
    conserved: bool = False,
) -> Iterator[Row]:  # fmt: skip
    """Fly every method at every setting, one after the other, short runs more than once.

    Args:
        case: Name of the motion.
        runs: The runs.
        judge: Judges them, after the clock has stopped.
        clock: The clock.
        lost: Error of the final state beyond which it is said to be lost.
        per: What times are divided by.
        conserved: Whether energy and closures are judged, too.
    """
    refused: set[str] = set()
    for method, setting, prepare in runs:
        if method in refused:
            continue
        row = Row(case, method=method, setting=setting)
        try:
            run = prepare()
        except NotComparableError as why:
            refused.add(method)
            yield row._replace(setting="", note=str(why))
            continue
        try:
            (q, v, steps), seconds = _timed(run, clock)
            if seconds < AGAIN:
                seconds = min(seconds, *(_timed(run, clock)[1] for _ in range(TIMES - 1)))
        except (NotComparableError, HybridynError) as why:
            yield row._replace(note=f"refused: {str(why).splitlines()[0]}")
            continue
        row = row._replace(seconds=seconds / per, error=judge.error(q[-1], v[-1]), value=steps, unit="steps")
        if not row.error < lost:
            yield row._replace(note="lost: it left the motion")
            continue
        energy, closure = judge.kept(q, v) if conserved else (NAN, NAN)
        yield row._replace(energy=energy, closure=closure)


def _timed(run: Callable[[], Flown], clock: Clock) -> tuple[Flown, float]:
    """Return what a run gave, and its time [s]."""
    started = clock()
    flown = run()
    return flown, clock() - started


def in_mujoco(
    at: Start, integrator: str, step: float, constant: float, iterations: int = 0,
    law: Callable[[mujoco_engine.MujocoEngine], Callable[[int], None]] | None = None,
) -> Callable[[], Callable[[], Flown]]:  # fmt: skip
    """Return what prepares a run of MuJoCo.

    Args:
        at: The start; effects are left out where it states none, and its efforts are applied.
        integrator: Name of the integrator.
        step: [s].
        constant: Time constant of the closures [s].
        iterations: Most iterations, 0 for MuJoCo's own choice.
        law: Prepares a control, and gives what sets it before a step.
    """

    def prepare() -> Callable[[], Flown]:
        own = mujoco_engine.closed(at.robot, rigid=at.effects is None)
        mujoco = own.mujoco
        own.model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
        own.model.opt.timestep = step
        own.model.opt.iterations = iterations or own.model.opt.iterations
        own.model.eq_solref[:] = (constant, 1.0)
        own.model.jnt_limited[:] = 0
        own.model.eq_solimp[:, :2] = 0.9999
        steps = round(at.duration / step)
        every = 1 if law else max(1, steps // SAMPLES)
        steer = law(own) if law else None

        def run() -> Flown:
            mujoco.mj_resetData(own.model, own.data)
            own.place(at.q, at.v)
            if at.effects is None:
                own.data.qfrc_applied[own.v_at[at.robot.motor_v]] = at.effort
            states = [own.state()]
            for k in range(0, steps, every):
                if steer:
                    steer(k)
                mujoco.mj_step(own.model, own.data, nstep=min(every, steps - k))
                if not steer or k == steps - 1:
                    states.append(own.state())
            return np.array([q for q, _ in states]), np.array([v for _, v in states]), steps

        return run

    return prepare
