"""Judge an engine: what becomes of each closure, and errors.

A closure is judged by what the engine's accelerations do to it, not by what the engine says of it: some
engines take a constraint and leave it out of the dynamics. Two things are measured. `felt_rows` finds the
rows along which the engine's constraints act, from its answers to a force on each freedom in turn; rows of a
closure outside them are lost. That is a property of the robot in the engine, not of a state. Of a closure
that lost none, the acceleration with which it opens, as a part of that of the tree without closures, says
whether it is rigid.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import pinocchio as pin

from ...spatial import Array
from ...structure.robot import HybridRobot
from .peer_engine import NotComparableError, PeerEngine
from .states import DEPENDENT, ComparedState, apart, closure_names, closure_slices

Fate = Literal["held", "softened", "partial", "ignored"]

#: A constraint acts along a direction if it takes up more than this part of a force there. The stiffest takes
#: up all, the softest of MuJoCo (impedance 1e-4) less.
FELT = 1e-3
#: A row counts as one of the engine's if its sine from the space of those is below this: files are rounded.
SAME_ROW = 1e-3
#: Acceleration that the force on a freedom alone would give it, in the units of the freedoms [1/s^2].
PROBE = 10.0
#: Smallest opening of the free tree, relative to the robot's accelerations, that shows if a closure acts.
SHOWS = 1e-6


@dataclass(frozen=True)
class ClosureFate:
    """What an engine makes of a closure or coupling.

    Attributes:
        left: Largest opening acceleration in the engine over that of the tree without closures; 0 is rigid.
        fate: "held", "softened", "partial" (some of its rows are lost) or "ignored".
        lost: Number of its independent rows that the engine does not hold.
        rows: Number of its independent rows.
    """

    name: str
    left: float
    fate: Fate
    lost: int = 0
    rows: int = 0


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
    build: Callable[[], PeerEngine],
    robot: HybridRobot,
    states: list[ComparedState],
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
    engine: PeerEngine,
    states: list[ComparedState],
    names: tuple[str, str],
    tolerance: float,
) -> Verdict:
    """Judge an engine at closed states.

    Args:
        engine: The robot inside the engine.
        names: Name and version of the engine.
        tolerance: Part of the free opening up to which a closure counts as held.
    """
    closures = _closures(robot, engine, states, tolerance)
    acceleration, effort = np.zeros(()), np.zeros(())
    for state in states:  # np.maximum keeps nan
        theirs = engine.forward(state.q, state.v, state.force)
        acceleration = np.maximum(acceleration, _difference(theirs, state.a))
        effort = np.maximum(effort, _effort_error(robot, engine, state))
    return Verdict(
        *names,
        engine.way,
        freedoms=engine.freedoms(states[0].q),
        closures=closures,
        acceleration=float(acceleration),
        effort=float(effort),
        notes=engine.notes,
    )


def _closures(
    robot: HybridRobot, engine: PeerEngine, states: list[ComparedState], tolerance: float
) -> tuple[ClosureFate, ...]:
    """Judge every closure and coupling; arguments as in `judge`."""
    names, slices = closure_names(robot), closure_slices(robot)
    if not names:
        return ()
    K = states[0].K / robot_sizes(robot, states[0].q)
    felt = felt_rows(robot, engine, states[0].q)
    out = []
    for name, at, left in zip(names, slices, _left(robot, engine, states), strict=True):
        others = np.delete(K, at, axis=0)
        own, basis = _rank(K) - _rank(others), _row_space(K[at])
        lost = int((np.linalg.svd(basis - basis @ felt.T @ felt, compute_uv=False) > SAME_ROW).sum())
        fate: Fate = "held" if left <= tolerance else "softened"
        if lost:
            fate = "ignored" if lost >= (own or len(basis)) else "partial"
        out.append(ClosureFate(name, float(left), fate, lost, len(basis)))
    return tuple(out)


def robot_sizes(robot: HybridRobot, q: Array) -> Array:
    """Return the roots of the inertias that the freedoms feel alone, in units of the freedoms, shape (nv,).

    Divided by them, rates have the size of their kinetic energy. A freedom without inertia keeps its unit.
    """
    M = pin.crba(robot.unchanged_model, robot.unchanged_model.createData(), q)
    own = np.sqrt(np.maximum(np.diag(M), 0.0)) * robot.unit
    return np.where(own > 0.0, own, 1.0)


def felt_rows(robot: HybridRobot, engine: PeerEngine, q: Array) -> Array:
    """Find the rows along which an engine's constraints act, at rest.

    A force f on the joints gives an acceleration a, for which the engine's tree alone needs M a. Its
    constraints exert the rest, M a - f, which lies in the space of their rows.

    Returns:
        Orthonormal rows, shape (rank, nv), for rates in `robot_sizes`; none where the engine has no numbers.
    """
    size, rest = robot_sizes(robot, q), np.zeros(robot.nv)
    still = engine.inverse(q, rest, engine.forward(q, rest, rest))
    exerted = np.zeros((robot.nv, robot.nv))
    for i in range(robot.nv):
        force = rest.copy()
        force[i] = PROBE * size[i] ** 2 / robot.unit[i]
        tree = engine.inverse(q, rest, engine.forward(q, rest, force))
        exerted[:, i] = (tree - still - force) * robot.unit / size / (PROBE * size[i])
    if not np.isfinite(exerted).all():
        return np.zeros((0, robot.nv))
    U, s, _ = np.linalg.svd(exerted)
    out: Array = U[:, s > FELT].T
    return out


def _row_space(K: Array) -> Array:
    """Return an orthonormal basis of the rows of K, shape (rank, columns)."""
    _, s, Vt = np.linalg.svd(K, full_matrices=False)
    out: Array = Vt[s > DEPENDENT * s.max(initial=0.0)]
    return out


def _rank(K: Array) -> int:
    return len(_row_space(K)) if len(K) else 0


def _left(robot: HybridRobot, engine: PeerEngine, states: list[ComparedState]) -> Array:
    """Return for each closure its largest opening acceleration over that of the tree, shape (closures,)."""
    opened, stayed = np.zeros((2, len(closure_names(robot))))
    for state in states:
        start = robot.unchanged_model.createData(), state.q, state.v
        free = pin.aba(robot.unchanged_model, *start, state.force)
        size = float(np.abs(state.a).max(initial=0.0)) + float(np.abs(state.v).max(initial=0.0)) ** 2
        opens = np.array(apart(robot, state.q, state.v, np.array(free)))
        stays = np.array(apart(robot, state.q, state.v, engine.forward(state.q, state.v, state.force)))
        shows = opens > SHOWS * max(size, 1e-300)
        opened = np.maximum(opened, np.where(shows, opens, 0.0))
        stayed = np.maximum(stayed, np.where(shows, stays, 0.0))  # keeps nan
    out: Array = np.where(opened > 0.0, stayed / np.where(opened > 0.0, opened, 1.0), 0.0)
    return np.nan_to_num(out, nan=np.inf)


def _difference(theirs: Array, ours: Array) -> float:
    size = float(np.abs(ours).max(initial=0.0))
    miss = float(np.abs(theirs - ours).max(initial=0.0))
    return miss / size if size else miss


def _effort_error(robot: HybridRobot, engine: PeerEngine, state: ComparedState) -> float:
    """Compare inverse dynamics on the freedoms that the closures leave."""
    forces = engine.inverse(state.q, state.v, state.a)
    _, s, vt = np.linalg.svd(state.K)
    basis = vt[(s > DEPENDENT * s.max(initial=0.0)).sum() :] * robot.unit
    ours = np.zeros(robot.nv)
    ours[robot.motor_v] = state.tau
    return _difference(basis @ forces, basis @ ours) if len(basis) else 0.0
