"""The libraries that close the loops of a robot, or of its designs: one for each choice of what is given."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ....assembly.requests import Requests
from ....assembly.spanning import spanning_positions
from ....errors import HybridynError
from ....linkage.newton import LoopProblem, close
from ....manifold.manifold import Manifold
from ....spatial import Array, Mask
from ....structure.parameters.entries import Parameters
from ....structure.robot import HybridRobot
from ...code.scalars import Scalar
from ...failures import check_agreement
from ...library.artifact import Artifact
from ...library.building import best_lanes
from ...library.cache import Built
from ...library.closed_rows import ClosedRows, Rows
from ..designs import designs_to_verify
from ..sources import kept, robot_key
from .given import (
    CLOSED_TO_ROUNDING,
    Part,
    lanes_for,
    module_requests,
    numbers,
    parts_of,
    places_at,
    structure_of,
)

if TYPE_CHECKING:
    from ....assembly.module_request import ModuleRequest
    from ...code.library_source import Source


@dataclass(frozen=True)
class Closing:
    """The library for one choice of given joints and targets.

    Attributes:
        parts: The modules that it closes.
        rows: The loaded library.
    """

    parts: list[Part]
    rows: ClosedRows


class ClosingLibraries:
    """Loads libraries as requests need them, and keeps the last ones."""

    def __init__(self, robot: HybridRobot, designs: Parameters | None = None, *, quick: bool = False) -> None:
        """Start without any library.

        Args:
            designs: Numbers that are arguments, of designs in lanes; None for rows of the robot itself.
            quick: Whether a quick build serves.
        """
        self.robot, self._designs, self._quick = robot, designs, quick
        self._known: dict[tuple[object, ...], Closing | None] = {}

    def known(self, requests: Requests) -> Closing | None:
        """Return the library for requests if it is loaded."""
        return self._known.get(structure_of(requests))

    def asked(self, requests: Requests) -> tuple[Closing, Rows] | None:
        """Return the library for requests, built if it is new, and what they prescribe, see `numbers`.

        None if the general path must close the loops; it says what is wrong, after the modules before.
        """
        try:
            wanted = self._wanted(requests)
            if wanted is None:
                return None
            closing = kept(self._known, structure_of(requests), partial(self._loaded, requests, wanted))
        except HybridynError:
            return None
        return None if closing is None else (closing, numbers(closing.parts, wanted))

    def artifact(self, requests: Requests) -> Artifact | None:
        """Return the library for requests, built or not; None if the general path closes the loops."""
        wanted = self._wanted(requests)
        parts = parts_of(self.robot, wanted) if wanted else None
        return self._artifact(requests, parts) if parts else None

    def _wanted(self, requests: Requests) -> list[ModuleRequest] | None:
        """Return what is asked of each module, or None if the general path must close the loops."""
        if self._designs is not None and (self.robot.base != "fixed" or self.moves_posed_links(requests)):
            return None
        return module_requests(self.robot, requests)

    def moves_posed_links(self, requests: Requests) -> bool:
        """Return whether a number of the designs places a link in its body whose whole pose is prescribed.

        Prescribed poses are those of bodies, computed once; those of coordinates are computed in C.
        """
        joints = self.robot.description.joints
        above = {joint.child: joint for joint in joints if joint.kind == "fixed"}
        slots = self._designs.slots if self._designs else ()
        placing = {slot.name for slot in slots if slot.table == "joints"}
        for pose in requests.poses:
            for link in (pose.link, pose.other) if pose.motion is not None else ():
                while link in above:
                    if above[link].name in placing:
                        return True
                    link = above[link].parent
        return False

    def _loaded(self, requests: Requests, wanted: list[ModuleRequest]) -> Closing | None:
        """Load the library for a choice of given joints and targets; None if there is none."""
        parts = parts_of(self.robot, wanted)
        alone = getattr(sys, "_is_gil_enabled", lambda: True)()  # rows share one workspace
        if parts is None or (self._designs is None and not (alone and best_lanes() > 1)):
            return None
        otherwise = f"{'assemble' if self._designs is None else 'designs'}: the general path closes the loops"
        rows = self._artifact(requests, parts).tried(self._rows, otherwise, quick=self._quick)
        return None if rows is None else Closing(parts, rows)

    def _rows(self, built: Built) -> ClosedRows:
        return ClosedRows(built, free=self._designs is not None)

    def _artifact(self, requests: Requests, parts: list[Part]) -> Artifact:
        """Return the library of some parts; a new one is compared with the general path at some designs."""
        robot, designs = self.robot, self._designs
        slots = None if designs is None else designs.slots
        lanes = best_lanes() if designs is not None else min(best_lanes(), lanes_for(parts))
        scalar = Scalar("float64", lanes)

        def write() -> Source:
            """Generate the C source."""
            from ...equations.arguments import ChosenNumbers
            from .closing_source import closing_source

            return closing_source(
                robot, parts, scalar, None if slots is None else ChosenNumbers(robot, slots)
            )

        def check(built: Built) -> None:
            """Compare a new library with the general path."""
            rows = self._rows(built)
            if designs is None:
                check_rows(rows, robot, parts, np.zeros(0))
                return
            for design, like, _ in designs_to_verify(robot, designs):
                if own := _like(parts, like, requests):
                    check_rows(rows, like, own, design)

        name = f"closing {structure_of(requests)!r} {robot_key(robot, None)} {scalar!r} {slots!r}"
        return Artifact(robot, name, write, check)


def _like(parts: list[Part], robot: HybridRobot, requests: Requests) -> list[Part]:
    """Return the parts of another design for the same requests; none if its structure is another."""
    try:
        wanted = module_requests(robot, requests)
        own = None if wanted is None else parts_of(robot, wanted)
    except HybridynError:
        return []
    structures = [
        [(part.given, part.module.mechanism.spec.topology) for part in group] for group in (own or [], parts)
    ]
    return own if own and structures[0] == structures[1] else []


def place_of(robot: HybridRobot, parts: list[Part], guess: Array) -> Rows | None:
    """Return the closed posture at a guess, see `ClosedRows.close`; None if its loops do not close near it.

    None, too, where an angle may be meant in another triple than the upright one, which kernels know.

    Args:
        parts: Its modules but a free base.
        guess: Positions of the spanning tree, shape (nq,).
    """
    q, cut = guess.copy(), []
    for part in parts:
        m, at = part.module.mechanism, part.module.q_index
        x = m.cut.positions(q[None, at])
        if m.closures.rows:
            scale = m.reduction.row_scale
            open_by = np.abs(m.closures.residual(x, m.tree.sweep(x)) * scale).max()
            if not open_by <= CLOSED_TO_ROUNDING:
                every = np.ones(m.tree.nv, dtype=bool)
                found = close(LoopProblem(m.closures, scale, m.reduction.col_scale, every), x)
                if not found.residual[0] <= max(robot.closure_tolerance, 1e-12):
                    return None
                x = found.q
                q[at] = spanning_positions(part.module, x, m.tree.sweep(x), q[at])[0]
        motion = m.tree.sweep(x)
        if any(one.may_be_mirrored(motion) for one in part.given.coordinates):
            return None
        cut.append(x)
    p, g = places_at(parts, cut, 1)
    return q, p[0], g[0]


#: Number of generic postures that are tried, and how far the row is from each (rad, module lengths).
POSTURES, ROW_AWAY = 4, 1e-3
#: Largest difference from the general path, relative to the largest entry of each result: rounding, through
#: the condition of loops at any posture.
ROWS_AGREE = 1e-8


def check_rows(rows: ClosedRows, robot: HybridRobot, parts: list[Part], design: Array) -> None:
    """Compare rows near generic postures with moving states of the general path.

    Args:
        rows: The library, as far as it is certain.
        robot: The robot, or another design of it.
        parts: The modules that it closes.
        design: Numbers in the slots, shape (slots,).

    Raises:
        CompileError: A row of which the library is certain differs.
    """
    compared, manifold = _compared(robot, parts), Manifold(robot)
    for number in range(POSTURES):
        start, wanted = robot.home.copy(), (robot.home.copy(), *np.zeros((2, robot.nv)))
        given = [_move(part, number, start, wanted) for part in parts]
        room = [x[None, None].copy() for x in wanted]
        place = place_of(robot, parts, start)
        row = [np.concatenate(own)[None] for own in zip(*given, strict=True)]
        if place is None or not rows.close(design[None], place, row, room, guess=False, strict=True)[0]:
            continue
        q, v, _ = found = [x[0, 0] for x in room]
        spun = (
            [manifold.residual(q)[0], manifold.opening(q, v)[0]] if any(part.spins for part in parts) else []
        )
        offs = [
            np.abs(x - right)[at].max(initial=0.0) / (1.0 + np.abs(right).max())
            for x, right, at in zip(found, wanted, compared, strict=True)
        ]
        check_agreement(robot, "motion of the loops", [*offs, *spun], ROWS_AGREE)


def _compared(robot: HybridRobot, parts: list[Part]) -> tuple[Mask, Mask, Mask]:
    """Return the positions, rates and accelerations that do not depend on how far rods have spun."""
    q, v = np.ones(robot.nq, dtype=bool), np.ones(robot.nv, dtype=bool)
    for part in parts:
        module, m = part.module, part.module.mechanism
        balls = [m.spec.tree_joint[m.tree.dof_body[spin.col] - 1] for spin in part.spins]
        wrists = [joint for wrist in m.spec.wrists for joint in wrist.joints if part.spins]
        for joint in (*balls, *wrists):
            if joint is not None:
                q[module.q_index[m.spanning.q_slices[joint]]] = False
                v[module.v_index[m.spanning.v_slices[joint]]] = False
    return q, v, v


def _move(part: Part, number: int, start: Array, wanted: Rows) -> Rows:
    """Write a closed posture of a module into `start`, a moving state nearby into `wanted`.

    Returns:
        What is prescribed in that state, its rates and accelerations, shapes (numbers,), (rates,), (rates,).
    """
    module, m = part.module, part.module.mechanism
    rng, tree = np.random.default_rng(number), m.tree
    at, to = module.q_index, module.v_index
    x = m.postures[number % len(m.postures)][None]
    start[at] = spanning_positions(module, x, tree.sweep(x), start[at])[0]
    Psi = m.basis(m.closures.matrix(tree.sweep(x))).Psi
    way = Psi @ rng.normal(size=m.mobility)
    size = np.abs(way / m.reduction.col_scale).max(initial=1.0)
    every, r = np.ones(tree.nv, dtype=bool), m.reduction
    near = tree.integrate(x, ROW_AWAY / size * way)
    x = close(LoopProblem(m.closures, r.row_scale, r.col_scale, every, (), r.rank), near).q
    K = m.closures.matrix(tree.sweep(x))
    x_dot = m.basis(K).Psi @ rng.normal(size=m.mobility)
    basis = m.basis(K, m.closures.rates(tree.sweep(x, x_dot), x_dot)[1])
    x_ddot = basis.Psi @ rng.normal(size=m.mobility) + basis.drift
    motion = tree.sweep(x, x_dot, x_ddot)
    q = spanning_positions(module, x, motion, start[at])
    v, a = m.cut.to_spanning(x_dot), m.cut.to_spanning(x_ddot)
    m.wrists.recover(q, v, None, motion)
    m.wrists.recover(q, v, a, motion)
    wanted[0][at], wanted[1][to], wanted[2][to] = q[0], v[0], a[0]
    held, bodies = part.given.columns(tree), part.given.bodies
    twists = [np.concatenate([motion.p_dot[0, b], motion.w[0, b]]) for b in bodies]
    accelerations = [np.concatenate([motion.p_ddot[0, b], motion.w_dot[0, b]]) for b in bodies]
    for one in part.given.coordinates:
        first = np.zeros(1, dtype=int)
        twists.append((one.target.matrix(tree, motion) @ x_dot[0])[0])
        accelerations.append(-one.target.rates(motion, first)[1][0])
    return (
        part.given.of_posture(tree, x)[0],
        np.concatenate([x_dot[0, held], *twists]),
        np.concatenate([x_ddot[0, held], *accelerations]),
    )
