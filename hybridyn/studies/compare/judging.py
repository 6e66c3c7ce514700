"""Judge an engine: what becomes of each closure, errors, drift, time of a call.

A closure is judged by what the engine's accelerations do to it, not by what the engine says of it: some
engines take a constraint and leave it out of the dynamics. The measure is the acceleration with which the
closure opens, as a part of that of the tree without closures.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import pinocchio as pin

from ...errors import HybridynError
from ...spatial import Array
from ...structure.robot import HybridRobot
from .engine import Engine
from .states import State, apart, closure_names, open_by

Fate = Literal["held", "softened", "ignored"]

#: Part of the free opening above which a closure counts as ignored, below as softened: springs and
#: regularisation of engines leave a tenth of it at most.
IGNORED = 0.5
#: Smallest opening of the free tree, relative to the robot's accelerations, that shows if a closure acts.
SHOWS = 1e-6
#: Calls whose median is the time of a call, and the seconds that they may take.
CALLS, CALL_SECONDS = 50, 0.3
#: Length of the simulation [s].
SECONDS = 1.0


@dataclass(frozen=True)
class ClosureFate:
    """What an engine makes of a closure or coupling.

    Attributes:
        left: Opening acceleration in the engine over that of the tree without closures; 0 is rigid.
        fate: "held", "softened" or "ignored".
        drift: Largest residual in the simulation, over the module's length, or None.
    """

    name: str
    left: float
    fate: Fate
    drift: float | None = None


@dataclass(frozen=True)
class Verdict:
    """What one engine makes of the robot in one way.

    Attributes:
        way: How the robot came into it.
        refusal: Why it cannot be compared, or "".
        freedoms: Freedoms that it leaves, or None if it does not say.
        closures: What becomes of every closure and coupling.
        acceleration: Largest relative difference of accelerations, or None.
        effort: Largest relative difference of inverse dynamics on the closed robot's freedoms, or None.
        drift: Largest closure residual in a simulation, over the module's length; infinite if it failed.
        seconds: Time of one direct dynamics [s], or None.
        notes: Remarks.
    """

    engine: str
    version: str
    way: str
    refusal: str = ""
    freedoms: int | None = None
    closures: tuple[ClosureFate, ...] = ()
    acceleration: float | None = None
    effort: float | None = None
    drift: float | None = None
    seconds: float | None = None
    notes: tuple[str, ...] = field(default=())

    def named(self, fate: Fate) -> list[str]:
        """Return the names of the closures with this fate."""
        return [closure.name for closure in self.closures if closure.fate == fate]

    def agrees(self, robot_freedoms: int, tolerance: float) -> bool:
        """Check whether the engine computes the same robot, to a relative tolerance."""
        numbers = [x for x in (self.acceleration, self.effort) if x is not None]
        return (
            not self.refusal
            and self.freedoms in (None, robot_freedoms)
            and not self.named("ignored")
            and not self.named("softened")
            and all(x <= tolerance for x in numbers)
        )


def judge(
    robot: HybridRobot,
    engine: Engine,
    states: list[State],
    names: tuple[str, str],
    tolerance: float,
    start: Array | None,
) -> Verdict:
    """Judge an engine at closed states.

    Args:
        engine: The robot inside the engine.
        names: Name and version of the engine.
        tolerance: Part of the free opening up to which a closure counts as held.
        start: Posture from which the engine simulates; None leaves it out.
    """
    left, acceleration = np.zeros(len(closure_names(robot))), 0.0
    efforts: list[float | None] = []
    for state in states:
        theirs = engine.forward(state.q, state.v, state.force)
        left = np.maximum(left, _left(robot, state, theirs))
        acceleration = max(acceleration, _difference(theirs, state.a))
        efforts.append(_effort_error(robot, engine, state))
    opened = None if start is None else _simulated(robot, engine, start)
    fates = tuple(
        ClosureFate(name, float(part), _fate(float(part), tolerance), None if opened is None else opened[i])
        for i, ((name, _), part) in enumerate(zip(closure_names(robot), left, strict=True))
    )
    first = states[0]
    return Verdict(
        *names,
        engine.way,
        freedoms=engine.freedoms(first.q),
        closures=fates,
        acceleration=acceleration,
        effort=None if None in efforts else max(error for error in efforts if error is not None),
        drift=None if opened is None else max(opened, default=0.0),
        seconds=call_time(engine.call(first.q, first.v, first.force)),
        notes=engine.notes,
    )


def _fate(part: float, tolerance: float) -> Fate:
    return "held" if part <= tolerance else "softened" if part < IGNORED else "ignored"


def _left(robot: HybridRobot, state: State, theirs: Array) -> Array:
    """Return for each closure its opening acceleration over that of the free tree, shape (closures,)."""
    free = pin.aba(robot.unchanged_model, robot.unchanged_model.createData(), state.q, state.v, state.force)
    size = float(np.abs(state.a).max(initial=0.0)) + float(np.abs(state.v).max(initial=0.0)) ** 2
    opens = np.array(apart(robot, state.q, state.v, np.array(free)))
    stays = np.array(apart(robot, state.q, state.v, theirs))
    shows = opens > SHOWS * max(size, 1e-300)
    out: Array = np.where(shows, stays / np.where(shows, opens, 1.0), 0.0)
    return np.nan_to_num(out, nan=np.inf)


def _difference(theirs: Array, ours: Array) -> float:
    size = float(np.abs(ours).max(initial=0.0))
    miss = float(np.abs(theirs - ours).max(initial=0.0))
    return miss / size if size else miss


def _effort_error(robot: HybridRobot, engine: Engine, state: State) -> float | None:
    """Compare inverse dynamics on the freedoms that the closures leave; None if there is none."""
    forces = engine.inverse(state.q, state.v, state.a)
    if forces is None:
        return None
    _, s, vt = np.linalg.svd(state.K) if len(state.K) else (None, np.zeros(0), np.eye(robot.nv))
    rank = int((s > 1e-9 * max(s[0], 1e-300)).sum()) if len(s) else 0
    basis = vt[rank:] * robot.unit
    ours = np.zeros(robot.nv)
    ours[robot.motor_v] = state.tau
    return _difference(basis @ forces, basis @ ours) if len(basis) else 0.0


def _simulated(robot: HybridRobot, engine: Engine, start: Array) -> list[float]:
    """Return the largest residual of each closure over a simulation; infinite where it broke down."""
    worst = np.zeros(len(closure_names(robot)))
    try:
        for q in engine.run(start, SECONDS):
            worst = np.maximum(worst, np.nan_to_num(open_by(robot, q), nan=np.inf))
    except (HybridynError, ArithmeticError, RuntimeError, ValueError):
        worst[:] = np.inf
    return [float(x) for x in worst]


def call_time(call: object) -> float:
    """Return the median time of a call [s]."""
    assert callable(call)
    times: list[float] = []
    end = time.perf_counter() + CALL_SECONDS
    for _ in range(CALLS):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
        if times[-1] + start > end:
            break
    return float(np.median(times))
