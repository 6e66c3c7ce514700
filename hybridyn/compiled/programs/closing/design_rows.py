"""Rows of a table closed for many designs at once: each lane of the vector unit holds a design.

The steps are those of `c/closing.h`, row after row: Newton's method from the row before, until the step is
rounding, and the comparison of the step with its prediction. Designs at which that is not certain are left to
the general path.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ....assembly.follow import MOST_TURNING, SAME_BRANCH, SMALL_STEP
from ....assembly.requests import Requests
from ....errors import CompileError, HybridynError
from ....spatial import Array, Index, Mask
from ....structure.parameters.slots import Slot
from ....structure.robot import HybridRobot
from ...code.scalars import GUARD_LIMIT, Scalar
from ...failures import as_compile_error
from ...library.cache import cached
from ...library.calls import Library, loaded
from ...library.compilers import best_lanes
from ...needs import needs_casadi
from ..sources import robot_key
from .choosing import module_requests, numbers, parts_of, structure_of
from .part import CLOSED_TO_ROUNDING, ITERATIONS, LAST_ROW_STEP, PATIENCE, QUADRATIC, Part

if TYPE_CHECKING:
    from ....assembly.module_request import ModuleRequest
    from ...code.library_source import Source

log = logging.getLogger("hybridyn.compiled")

#: Most last steps: each squares the one before.
LAST_STEPS = 3


@dataclass
class DesignPostures:
    """Postures of designs, (q, p) as in `kernels`."""

    q: Array
    p: Array

    def take(self, rows: Index | Mask) -> DesignPostures:
        """Return those of some designs."""
        return DesignPostures(self.q[rows], self.p[rows])

    def moved(self, other: DesignPostures, where: Mask) -> DesignPostures:
        """Return those of another step for some designs: no design depends on how many steps others need."""
        if where.all():
            return other
        return DesignPostures(
            *(np.where(where[:, None], x, y) for x, y in ((other.q, self.q), (other.p, self.p)))
        )


@dataclass(frozen=True)
class DesignStates:
    """States of designs along a table.

    Attributes:
        q, v, a: Shapes (T, designs, nq), (T, designs, nv), (T, designs, nv).
        certain: Designs whose states are certain at every row, shape (designs,).
    """

    q: Array
    v: Array
    a: Array
    certain: Mask


class DesignRows:
    """Closes rows for designs of one robot; programs are kept for each choice of given joints and targets."""

    def __init__(self, robot: HybridRobot, slots: tuple[Slot, ...]) -> None:
        self.robot, self.slots = robot, slots
        self._known: dict[tuple[object, ...], tuple[list[Part], Library] | None] = {}

    def follow(self, requests: Requests, slots: Array) -> DesignStates:
        """Compute the states of each design along a table.

        Args:
            requests: The table.
            slots: Numbers in the slots, shape (designs, slots).
        """
        T, D, robot = requests.samples, len(slots), self.robot
        q, v, a = (np.full((T, D, width), np.nan) for width in (robot.nq, robot.nv, robot.nv))
        out = DesignStates(q, v, a, np.zeros(D, dtype=bool))
        possible = robot.base == "fixed" and not self._moves_posed_links(requests)
        wanted = module_requests(robot, requests) if possible else None
        closing = None if wanted is None else self._closing(requests, wanted)
        if wanted is None or closing is None:
            return out
        parts, library = closing
        g, g_dot, g_ddot = numbers(parts, wanted)
        step = _Step(library, slots, len(parts), robot.nv)
        live = np.arange(D)
        at, good = step.reached(self._home(parts, D), g[0])
        for t in range(T):
            if not good.all():
                live, at = live[good], at.take(good)
            if not len(live):
                return out
            at, v, a, good = step.advanced(live, at, (g[t], g_dot[t], g_ddot[t]), free=t == 0)
            out.q[t, live], out.v[t, live], out.a[t, live] = at.q, v, a
        out.certain[live[good]] = True
        return out

    def _moves_posed_links(self, requests: Requests) -> bool:
        """Return whether a slot places a link in its body whose whole pose is prescribed.

        Prescribed poses are those of bodies, computed once; those of coordinates are computed in C.
        """
        joints = self.robot.description.joints
        above = {joint.child: joint for joint in joints if joint.kind == "fixed"}
        placing = {slot.name for slot in self.slots if slot.table == "joints"}
        for pose in requests.poses:
            for link in (pose.link, pose.other) if pose.motion is not None else ():
                while link in above:
                    if above[link].name in placing:
                        return True
                    link = above[link].parent
        return False

    def _home(self, parts: list[Part], designs: int) -> DesignPostures:
        """Return the robot's home posture for each design; its platforms are where the robot has them."""
        q, poses = self.robot.home, [np.zeros(0)]
        for part in parts:
            m = part.module.mechanism
            x = m.cut.positions(q[None, part.module.q_index])[0]
            poses += [x[m.tree.q_slices[i]] for i in m.spec.platforms]
        return DesignPostures(np.tile(q, (designs, 1)), np.tile(np.concatenate(poses), (designs, 1)))

    def _closing(self, requests: Requests, wanted: list[ModuleRequest]) -> tuple[list[Part], Library] | None:
        """Return the parts and the library for a choice of given joints and targets, or None."""
        key = structure_of(requests)
        if key not in self._known:
            try:
                parts = parts_of(self.robot, wanted)
                self._known[key] = None if parts is None else (parts, self._library(parts, key))
            except CompileError as error:
                log.warning("designs: the general path closes the loops (%s)", error)
                self._known[key] = None
            except HybridynError:  # the nominal design cannot be assembled: others may be
                return None
        return self._known[key]

    def _library(self, parts: list[Part], key: tuple[object, ...]) -> Library:
        """Load the library, and build it if it is new."""
        scalar, robot = Scalar("float64", best_lanes()), self.robot

        def source() -> Source:
            """Generate the C source."""
            needs_casadi()
            from ...code.library_source import library_source
            from ...equations.arguments.chosen import ChosenNumbers
            from .closing_programs import closing_programs

            with as_compile_error(robot):
                programs = closing_programs(robot, parts, ChosenNumbers(robot, self.slots))
                return library_source(list(programs.values()), scalar)

        name = f"designs {key!r} {robot_key(robot, None)} {scalar!r} {self.slots!r}"
        return loaded(lambda: cached(name, source))


class _Step:
    """One row for many designs."""

    def __init__(self, library: Library, slots: Array, modules: int, rates: int) -> None:
        self.library, self.slots, self.modules, self.rates = library, slots, modules, rates

    def _run(self, name: str, live: Index, *inputs: Array) -> tuple[list[Array], Mask]:
        """Run a program for designs; return its outputs and where its guard is within the limit."""
        slots = self.slots if len(live) == len(self.slots) else self.slots[live]
        outputs, guard = self.library.batch(name, *inputs, slots)
        return list(outputs), guard <= GUARD_LIMIT

    def reached(self, at: DesignPostures, g: Array) -> tuple[DesignPostures, Mask]:
        """Go by Newton's method from a guess to the given positions, without damping (`reaches`)."""
        live = np.arange(len(at.q))
        given, good = np.tile(g, (len(live), 1)), np.ones(len(live), dtype=bool)
        before, near = np.full((len(live), self.modules), np.inf), ~good
        for _ in range(PATIENCE):
            (q, p, step, wrist, far), trusted = self._run("newton", live, at.q, at.p, given)
            good &= near | trusted & ((far < before) | (step < QUADRATIC)).all(axis=1)
            at, before = at.moved(DesignPostures(q, p), ~near), far
            near |= (np.maximum(step, wrist) <= QUADRATIC).all(axis=1)
            if near[good].all():
                break
        return at, good & near

    def advanced(
        self, live: Index, start: DesignPostures, given: tuple[Array, Array, Array], *, free: bool
    ) -> tuple[DesignPostures, Array, Array, Mask]:
        """Close a row on the branch of the row before; `free` where there is no row before.

        Returns:
            The postures, rates, accelerations, and where they are certain.
        """
        many = [np.broadcast_to(x, (len(live), len(x))) for x in given]
        (q, p, first, wrist, _), good = self._run("newton", live, start.q, start.p, many[0])
        at = predicted = DesignPostures(q, p)
        before = np.maximum(first, wrist).max(axis=1)
        for _ in range(ITERATIONS):
            left = before > QUADRATIC
            if not left[good].any():
                break
            (q, p, step, wrist, _), trusted = self._run("newton", live, at.q, at.p, many[0])
            size = np.maximum(step, wrist).max(axis=1)
            good &= ~left | (trusted & (size <= before))
            at, before = at.moved(DesignPostures(q, p), left), np.where(left, size, before)
        good &= before <= QUADRATIC
        left, v, a = np.ones(len(live), dtype=bool), *np.empty((2, len(live), self.rates))
        for _ in range(LAST_STEPS):
            (q, p, *rates, step, far), trusted = self._run("settle", live, at.q, at.p, *many)
            at = at.moved(DesignPostures(q, p), left)
            v, a = (np.where(left[:, None], new, old) for new, old in zip(rates, (v, a), strict=True))
            settled = step.max(axis=1) <= LAST_ROW_STEP
            good &= ~left | (trusted & (~settled | (far.max(axis=1) <= CLOSED_TO_ROUNDING)))
            left &= ~settled
            if not left[good].any():
                break
        good &= ~left
        if not free:
            good &= self._on_branch(live, start, predicted, at, many[0], first)
        return at, v, a, good

    def _on_branch(
        self,
        live: Index,
        start: DesignPostures,
        predicted: DesignPostures,
        found: DesignPostures,
        g: Array,
        first: Array,
    ) -> Mask:
        """Compare a step with its prediction, as `assembly.follow` does."""
        (off, turned), trusted = self._run(
            "branch", live, start.q, start.p, predicted.q, predicted.p, found.q, found.p, g
        )
        near = off <= SAME_BRANCH * first + SMALL_STEP
        straight = (first <= SMALL_STEP) | (turned <= MOST_TURNING)
        out: Mask = trusted & near.all(axis=1) & straight.all(axis=1)
        return out
