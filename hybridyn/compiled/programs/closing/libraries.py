"""The libraries that close the loops of a robot, or of its designs: one for each choice of what is given."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ....assembly.requests import Requests
from ....errors import HybridynError
from ....structure.parameters.entries import Parameters
from ....structure.robot import HybridRobot
from ...code.scalars import Scalar
from ...library.artifact import Artifact
from ...library.building import best_lanes
from ...library.cache import Built
from ...library.closed_rows import ClosedRows, Rows
from ..designs import designs_to_verify
from ..sources import kept, robot_key
from .checking import check_rows
from .choosing import Part, lanes_for, module_requests, numbers, parts_of, structure_of

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
            for design, like, _ in designs_to_verify(robot, designs) if designs is not None else ():
                own = _like(parts, like, requests)
                if own:
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
