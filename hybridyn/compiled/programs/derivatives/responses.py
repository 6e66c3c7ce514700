"""How all groups respond to a unit wrench on an output, and to unit accelerations and twists of it.

Responses are matrices for all lanes, column by column. Those to a wrench beta on an output, which what it
carries requires there, are found outwards from the group of the output: groups inwards of it respond as to
the wrench that it passes on.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from ...program import Each
from ..writer import Writer
from .dense import Term, add_terms, by_columns
from .groups import BASE, Group, Place
from .relations import Relations


@dataclass
class Responses:
    """Responses of groups.

    Attributes:
        writer: The program under construction.
        relations: Relations of each group, outwards.
        to_motion: Motions of the groups on a place over its acceleration and twist.
        to_wrench: Motions of groups over a wrench on a place: all but those that it carries alone.
        motion: Acceleration of a place over a wrench on it.
        own: Motions of each group over a wrench on its base, through the base's acceleration.
        onwards: Accelerations of places over that wrench, for motions of the group that it causes.
    """

    writer: Writer
    relations: Mapping[Group, Relations]
    to_motion: dict[Place, dict[Group, Each]] = field(default_factory=dict)
    to_wrench: dict[Place, dict[Group, Each]] = field(default_factory=dict)
    motion: dict[Place, Each] = field(default_factory=dict)
    own: dict[Group, Each] = field(default_factory=dict)
    onwards: dict[Place, Each] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Add all responses."""
        for group in reversed(list(self.relations)):
            for place in group.children:
                self._to_motion(group, place)
        roots = [group for group in self.relations if group.parent is None]
        if any(self.relations[group].moved[1] for group in roots):
            self.to_motion[BASE] = {}
            for group in roots:
                self._follow(BASE, group)
        for group in self.relations:
            self._settle(group)
            for place in group.children:
                self._to_wrench(group, place)

    def _to_motion(self, group: Group, place: Place) -> None:
        """Add the responses of what an output carries to its motion."""
        self.to_motion[place] = {}
        for child in group.children[place]:
            self._follow(place, child)

    def _follow(self, place: Place, child: Group) -> None:
        """Add the responses of a group and all that it carries to the motion of its base."""
        x = self.relations[child]
        first, count = x.moved
        n = child.mobility
        self.to_motion[place][child] = Each(x.motions.start + first * n, n)
        for output in child.children:
            A, V = (Each(end.start + first * end.size, end.size) for end in x.through[output])
            for group, known in self.to_motion[output].items():
                terms = [(by_columns(known, 0, A.size), A), (by_columns(known, A.size, V.size), V)]
                self.to_motion[place][group] = self._product(count, terms, [], group.mobility)

    def _to_wrench(self, group: Group, place: Place) -> None:
        """Add the responses of all groups to a wrench on an output."""
        x, at, n = self.relations[group], self.relations[group].wrench_at(place), group.mobility
        out = {group: Each(x.motions.start + at * n, n)}
        passed = None
        if x.wrenches is not None:
            passed = Each(x.wrenches.start + at * 6, 6)
            for other, known in self.to_wrench[group.base].items():
                if other not in group.subtree():
                    out[other] = self._product(6, [(by_columns(known, 0, 6), passed)], [], other.mobility)
        if passed is not None and group in self.own:
            out[group] = self._product(6, [(by_columns(self.own[group], 0, 6), passed)], [out[group]], n)
        for output in group.children if not x.held else ():
            A = x.through[output][0]
            moved = Each(A.start + at * 6, 6)
            if passed is not None:
                moved = self._product(6, [(by_columns(self.onwards[output], 0, 6), passed)], [moved], 6)
            if output == place:
                self.motion[place] = moved
            if output != place or len(group.children[place]) > 1:
                for other, known in self.to_motion[output].items():
                    out[other] = self._product(6, [(by_columns(known, 0, 6), moved)], [], other.mobility)
        self.to_wrench[place] = out

    def _settle(self, group: Group) -> None:
        """Add the responses of a group to the wrench on its base, which moves the base."""
        x, below = self.relations[group], self.motion.get(group.base)
        if below is None:
            return
        first = x.moved[0]
        K = by_columns(x.motions, first, 6)
        self.own[group] = self._product(6, [(K, below)], [], group.mobility)
        for place in group.children:
            over_A = by_columns(x.through[place][0], first, 6)
            self.onwards[place] = self._product(6, [(over_A, below)], [], 6)

    def _product(self, count: int, terms: Sequence[Term], more: list[Each], size: int) -> Each:
        """Add a sum of products, for all lanes."""
        out = self.writer.each(count, size)
        add_terms(self.writer, count, size, terms, more, out)
        return out
