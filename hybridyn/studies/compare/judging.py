"""Judge an engine: what becomes of each closure, and errors.

A closure is judged by what the engine's accelerations do to it, not by what the engine says of it: some
engines take a constraint and leave it out of the dynamics. The measure is the acceleration with which the
closure opens, as a part of that of the tree without closures.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import pinocchio as pin

from ...spatial import Array
from ...structure.robot import HybridRobot
from .engine import Engine, NotComparableError
from .states import DEPENDENT, State, apart, closure_names

Fate = Literal["held", "softened", "ignored"]

#: Part of the free opening above which a closure counts as ignored, below as softened: springs and
#: regularisation of engines leave a tenth of it at most.
IGNORED = 0.5
#: Smallest opening of the free tree, relative to the robot's accelerations, that shows if a closure acts.
SHOWS = 1e-6


@dataclass(frozen=True)
class ClosureFate:
    """What an engine makes of a closure or coupling.

    Attributes:
        left: Opening acceleration in the engine over that of the tree without closures; 0 is rigid.
        fate: "held", "softened" or "ignored".
    """

    name: str
    left: float
    fate: Fate


@dataclass(frozen=True)
class Verdict:
    """What one engine makes of the robot in one way.

    Attributes:
        way: How the robot came into it.
        refusal: Why it cannot be compared, or "".
        freedoms: Freedoms that it leaves, or None.
        closures: What becomes of every closure and coupling.
        acceleration: Largest relative difference of accelerations; nan for a refusal, as those below.
        effort: Largest relative difference of inverse dynamics on the closed robot's freedoms.
        notes: Remarks.
    """

    engine: str
    version: str
    way: str
    refusal: str = ""
    freedoms: int | None = None
    closures: tuple[ClosureFate, ...] = ()
    acceleration: float = np.nan
    effort: float = np.nan
    notes: tuple[str, ...] = field(default=())

    def named(self, fate: Fate) -> list[str]:
        """Return the names of the closures with this fate."""
        return [closure.name for closure in self.closures if closure.fate == fate]

    def agrees(self, robot_freedoms: int, tolerance: float) -> bool:
        """Check whether the engine computes the same robot, to a relative tolerance."""
        return (
            self.freedoms == robot_freedoms
            and all(closure.fate == "held" for closure in self.closures)
            and self.acceleration <= tolerance
            and self.effort <= tolerance
        )


def judge_way(
    way: str,
    build: Callable[[], Engine],
    robot: HybridRobot,
    states: list[State],
    names: tuple[str, str],
    tolerance: float,
) -> Verdict:
    """Build an engine and judge it as `judge` does; a refusal becomes part of the verdict."""
    notes: tuple[str, ...] = ()
    try:
        engine = build()
        notes = engine.notes
        return judge(robot, engine, states, names, tolerance)
    except (NotComparableError, RuntimeError, ValueError, ArithmeticError) as error:
        reason = " ".join(str(error).split())[:300] or type(error).__name__
        return Verdict(*names, way, refusal=reason, notes=notes)


def judge(
    robot: HybridRobot,
    engine: Engine,
    states: list[State],
    names: tuple[str, str],
    tolerance: float,
) -> Verdict:
    """Judge an engine at closed states.

    Args:
        engine: The robot inside the engine.
        names: Name and version of the engine.
        tolerance: Part of the free opening up to which a closure counts as held.
    """
    left, acceleration, effort = np.zeros(len(closure_names(robot))), np.zeros(()), np.zeros(())
    for state in states:  # np.maximum keeps nan
        theirs = engine.forward(state.q, state.v, state.force)
        left = np.maximum(left, _left(robot, state, theirs))
        acceleration = np.maximum(acceleration, _difference(theirs, state.a))
        effort = np.maximum(effort, _effort_error(robot, engine, state))
    fates = tuple(
        ClosureFate(name, float(part), _fate(float(part), tolerance))
        for name, part in zip(closure_names(robot), left, strict=True)
    )
    return Verdict(
        *names,
        engine.way,
        freedoms=engine.freedoms(states[0].q),
        closures=fates,
        acceleration=float(acceleration),
        effort=float(effort),
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


def _effort_error(robot: HybridRobot, engine: Engine, state: State) -> float:
    """Compare inverse dynamics on the freedoms that the closures leave."""
    forces = engine.inverse(state.q, state.v, state.a)
    _, s, vt = np.linalg.svd(state.K)
    basis = vt[(s > DEPENDENT * s.max(initial=0.0)).sum() :] * robot.unit
    ours = np.zeros(robot.nv)
    ours[robot.motor_v] = state.tau
    return _difference(basis @ forces, basis @ ours) if len(basis) else 0.0
