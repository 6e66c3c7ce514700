"""Rows of a table closed for many designs at once: each lane of the vector unit holds a design.

Row after row, `c/closing.h` takes Newton's method from the row before, until the step is rounding, and
compares the step with its prediction. Designs at which that is not certain are left to the general path.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ....assembly.requests import Requests
from ....errors import HybridynError
from ....spatial import Array, Mask
from ....structure.robot import HybridRobot
from ...code.scalars import Scalar
from ...library.building import best_lanes
from ...library.cache import Built
from ...library.closed_rows import ClosedDesigns
from ..designs import DesignsInSlots, designs_to_verify
from ..sources import Artifact, kept, robot_key
from .checking import Closer, check_rows
from .choosing import Closing, Part, module_requests, numbers, parts_of, places_at, structure_of

if TYPE_CHECKING:
    from ....assembly.module_request import ModuleRequest
    from ...code.library_source import Source

States = tuple[Array, Array, Array]


@dataclass(frozen=True, eq=False)
class DesignStates:
    """States of designs along a table.

    Attributes:
        q, v, a: Shapes (designs, T, nq), (designs, T, nv), (designs, T, nv).
        certain: Designs whose states are certain at every row, shape (designs,); others have no states.
    """

    q: Array
    v: Array
    a: Array
    certain: Mask


@dataclass(frozen=True)
class DesignRequests:
    """A table as the programs take it.

    Attributes:
        samples: Number of rows T.
        closing: The program, or None if the general path must close the loops.
        given: What is prescribed, its rates and accelerations, shapes (T, numbers), (T, rates), (T, rates).
        strict: Whether the first row is on the branch of the guess, as in `Requests`.
    """

    samples: int
    closing: Closing[ClosedDesigns] | None
    given: States
    strict: bool


class DesignRows:
    """Closes rows for designs of one robot; programs are kept for each choice of given joints and targets."""

    def __init__(self, designs: DesignsInSlots, threads: int = 1, *, quick: bool = False) -> None:
        self.designs, self.robot, self.threads, self.quick = designs, designs.robot, threads, quick
        self._known: dict[tuple[object, ...], Closing[ClosedDesigns] | None] = {}

    def requests(self, requests: Requests) -> DesignRequests:
        """Return a table as the programs take it."""
        wanted = self._wanted(requests)
        closing = None if wanted is None else self._closing(requests, wanted)
        given = (np.zeros((0, 0)),) * 3 if not (wanted and closing) else numbers(closing.parts, wanted)
        return DesignRequests(requests.samples, closing, given, requests.strict)

    def artifact(self, requests: Requests) -> Artifact | None:
        """Return the library for a table, built or not; None if the general path closes the loops."""
        wanted = self._wanted(requests)
        parts = parts_of(self.robot, wanted) if wanted else None
        return self._artifact(parts, requests) if parts else None

    def _wanted(self, requests: Requests) -> list[ModuleRequest] | None:
        """Return what is asked of each module, or None if the general path must close the loops."""
        possible = self.robot.base == "fixed" and not self._moves_posed_links(requests)
        return module_requests(self.robot, requests) if possible else None

    def _moves_posed_links(self, requests: Requests) -> bool:
        """Return whether a slot places a link in its body whose whole pose is prescribed.

        Prescribed poses are those of bodies, computed once; those of coordinates are computed in C.
        """
        joints = self.robot.description.joints
        above = {joint.child: joint for joint in joints if joint.kind == "fixed"}
        placing = {slot.name for slot in self.designs.parameters.slots if slot.table == "joints"}
        for pose in requests.poses:
            for link in (pose.link, pose.other) if pose.motion is not None else ():
                while link in above:
                    if above[link].name in placing:
                        return True
                    link = above[link].parent
        return False

    def states(
        self,
        table: DesignRequests,
        slots: Array,
        out: States | None = None,
    ) -> DesignStates:
        """Compute the states of each design along a table.

        Args:
            slots: Numbers in the slots, shape (designs, slots).
            out: Room for q, v, a, see `DesignStates`.
        """
        sizes, (nq, nv) = (len(slots), table.samples), (self.robot.nq, self.robot.nv)
        room = out or (np.empty((*sizes, nq)), np.empty((*sizes, nv)), np.empty((*sizes, nv)))
        certain = np.zeros(len(slots), dtype=bool)
        if table.closing is not None:
            start = _guess(table.closing.parts, self.robot.home)
            close = table.closing.rows.close
            count = close(slots, start, table.given, room, self.threads, strict=table.strict)
            certain = count == table.samples
        for x in room if not certain.all() else ():
            x[~certain] = np.nan
        return DesignStates(*room, certain)

    def _closing(self, requests: Requests, wanted: list[ModuleRequest]) -> Closing[ClosedDesigns] | None:
        """Return the program for a choice of given joints and targets, or None."""
        try:
            return kept(self._known, structure_of(requests), partial(self._loaded, requests, wanted))
        except HybridynError:  # the nominal design cannot be assembled: others may be
            return None

    def _loaded(self, requests: Requests, wanted: list[ModuleRequest]) -> Closing[ClosedDesigns] | None:
        """Load the program for a choice of given joints and targets; None if there is none."""
        parts = parts_of(self.robot, wanted)
        if parts is None:
            return None
        otherwise = "designs: the general path closes the loops"
        library = self._artifact(parts, requests).tried(ClosedDesigns, otherwise, quick=self.quick)
        return Closing(parts, library) if library else None

    def _artifact(self, parts: list[Part], requests: Requests) -> Artifact:
        """Return the library of some parts; a new one is compared with the general path at some designs."""
        scalar, robot, slots = Scalar("float64", best_lanes()), self.robot, self.designs.parameters.slots

        def write() -> Source:
            """Generate the C source."""
            from ...equations.arguments import ChosenNumbers
            from .closing_source import closing_source

            return closing_source(robot, parts, scalar, ChosenNumbers(robot, slots))

        def check(built: Built) -> None:
            """Compare a new library with the general path."""
            for design, like, _ in designs_to_verify(robot, self.designs.parameters):
                own = _like(parts, like, requests)
                if own:
                    check_rows(self._closer(ClosedDesigns(built), own, design), like, own)

        name = f"designs {structure_of(requests)!r} {robot_key(robot, None)} {scalar!r} {slots!r}"
        return Artifact(robot, name, write, check)

    def _closer(self, library: ClosedDesigns, parts: list[Part], design: Array) -> Closer:
        """Return the function that closes a row of one design, for `check_rows`."""

        def close(start: Array, given: States, room: States) -> bool:
            """Close a row, shapes (1, n), near a posture; return whether it is certain."""
            states = (room[0][None], room[1][None], room[2][None])
            return bool(library.close(design[None], _guess(parts, start), given, states)[0])

        return close


def _guess(parts: list[Part], q: Array) -> States:
    """Return a guess, shape (nq,), its platforms, as the nominal design has them, and what is given there."""
    cut = [part.module.mechanism.cut.positions(q[None, part.module.q_index]) for part in parts]
    p, g = places_at(parts, cut, 1)
    return q, p[0], g[0]


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
