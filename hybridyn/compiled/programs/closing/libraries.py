"""The libraries that close the loops of a robot, or of its designs: one for each choice of what is given."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ....assembly.chain.coupling import ways_between
from ....assembly.requests import Requests
from ....errors import HybridynError
from ....structure.parameters.chosen import Parameters
from ....structure.robot import HybridRobot
from ...code.scalars import Scalar
from ...library.artifact import Artifact
from ...library.building import best_lanes
from ...library.cache import Built
from ...library.closed_rows import ClosedRows, Rows
from ..designs import designs_to_verify
from ..sources import kept, robot_key
from .checked_rows import check_chains, check_rows
from .closing_library import Closing
from .coupled import Coupled, Split, split_poses
from .members import Wanted, members_of, wanted_of
from .module_parts import Part, lanes_for
from .own_requests import structure_of

if TYPE_CHECKING:
    from ...code.library_source import Source


class ClosingLibraries:
    """Loads libraries as requests need them, and keeps the last ones."""

    def __init__(self, robot: HybridRobot, designs: Parameters | None = None) -> None:
        """Start without any library.

        Args:
            designs: Numbers that are arguments, of designs in lanes; None for rows of the robot itself.
        """
        self.robot, self._designs = robot, designs
        self._known: dict[tuple[object, ...], Closing | None] = {}
        self._splits: dict[tuple[object, ...], Split] = {}

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
            closing = kept(self._known, structure_of(requests), partial(self._loaded, wanted))
        except HybridynError:
            return None
        return None if closing is None else (closing, closing.numbers(wanted))

    def artifact(self, requests: Requests) -> Artifact | None:
        """Return the library for requests, built or not; None if the general path closes the loops."""
        wanted = self._wanted(requests)
        members = None if wanted is None else members_of(self.robot, wanted)
        return None if members is None else self._artifact(requests, *members)

    def _wanted(self, requests: Requests) -> Wanted | None:
        """Return what is asked of each module, or None if the general path must close the loops."""
        if self._designs is not None and (self.robot.base != "fixed" or self.moves_posed_links(requests)):
            return None
        split = kept(self._splits, structure_of(requests), partial(split_poses, self.robot, requests))
        if self._designs is not None and any(self._moves_chain(requests, *chain) for chain in split[1]):
            return None
        return wanted_of(self.robot, requests, split)

    def moves_posed_links(self, requests: Requests) -> bool:
        """Return whether a number of the designs places a link in its body whose whole pose is prescribed.

        Prescribed poses are those of bodies, computed once; those of coordinates are computed in C.
        """
        whole = [pose for pose in requests.poses if pose.motion is not None]
        return self._placed(link for pose in whole for link in (pose.link, pose.other))

    def _placed(self, links: Iterable[str]) -> bool:
        """Return whether a number of the designs places one of some links in its body."""
        joints = self.robot.description.joints
        above = {joint.child: joint for joint in joints if joint.kind == "fixed"}
        slots = self._designs.slots if self._designs else ()
        placing = {slot.name for slot in slots if slot.table == "joints"}
        for link in links:
            while link in above:
                if above[link].name in placing:
                    return True
                link = above[link].parent
        return False

    def _moves_chain(self, requests: Requests, modules: Sequence[int], poses: Sequence[int]) -> bool:
        """Return whether a number of the designs moves what the kernels of a chain have as constants.

        These are frames in bodies, and those of modules that do not move.
        """
        robot, some = self.robot, [requests.poses[i] for i in poses]
        links = {link for pose in some for link in (pose.link, pose.other)}
        links |= {robot.modules[k].base for k in modules}
        on_the_way = {k for pose in some for way in ways_between(robot, pose) for k, _ in way}
        return self._placed(links) or not on_the_way <= {*modules}

    def _loaded(self, wanted: Wanted) -> Closing | None:
        """Load the library for a choice of given joints and targets; None if there is none."""
        members = members_of(self.robot, wanted)
        alone = getattr(sys, "_is_gil_enabled", lambda: True)()  # rows share one workspace
        if members is None or (self._designs is None and not (alone and best_lanes() > 1)):
            return None
        otherwise = f"{'assemble' if self._designs is None else 'designs'}: the general path closes the loops"
        rows = self._artifact(wanted.requests, *members).tried(self._rows, otherwise)
        return None if rows is None else Closing(members[0], rows, members[1])

    def _rows(self, built: Built) -> ClosedRows:
        return ClosedRows(built, free=self._designs is not None)

    def _artifact(self, requests: Requests, parts: list[Part], chains: list[Coupled]) -> Artifact:
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
                robot, parts, scalar, None if slots is None else ChosenNumbers(robot, slots), chains
            )

        def check(built: Built) -> None:
            """Compare a new library with the general path."""
            rows, nominal = self._rows(built), [(np.zeros(0), robot, True)]
            for design, like, _ in nominal if designs is None else designs_to_verify(robot, designs):
                own = (parts, chains) if like is robot else _like(parts, like, requests)
                if own and chains:
                    check_chains(Closing(own[0], rows, own[1]), like, requests, design)
                elif own:
                    check_rows(rows, like, own[0], design)

        name = f"closing {structure_of(requests)!r} {robot_key(robot, None)} {scalar!r} {slots!r}"
        return Artifact(robot, name, write, check)


def _like(
    parts: list[Part], robot: HybridRobot, requests: Requests
) -> tuple[list[Part], list[Coupled]] | None:
    """Return parts and chains of another design for the same requests; None if its structure is another."""
    try:
        wanted = wanted_of(robot, requests, split_poses(robot, requests))
        members = None if wanted is None else members_of(robot, wanted)
    except HybridynError:
        return None
    structures = [
        [(part.given, part.module.mechanism.spec.topology) for part in group]
        for group in (members[0] if members else [], parts)
    ]
    return members if structures[0] == structures[1] else None
