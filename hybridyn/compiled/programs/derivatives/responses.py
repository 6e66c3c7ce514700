"""What groups of modules do to those that they carry, and to those that carry them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby

from ...program import Each
from ..module_calls import ModuleCalls
from ..writer import Writer
from .columns import Term, add_terms, by_columns
from .connected import ConnectedModules, Place
from .matrix_names import MOTIONS, WRENCH
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
    relations: Mapping[ConnectedModules, Relations]
    to_motion: dict[Place, dict[ConnectedModules, Each]] = field(default_factory=dict)
    to_wrench: dict[Place, dict[ConnectedModules, Each]] = field(default_factory=dict)
    motion: dict[Place, Each] = field(default_factory=dict)
    own: dict[ConnectedModules, Each] = field(default_factory=dict)
    onwards: dict[Place, Each] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Add all responses."""
        for group in reversed(list(self.relations)):
            for place, children in group.children.items():
                self.to_motion[place] = {}
                for child in children:
                    self._follow(place, child)
        for group in self.relations:
            self._settle(group)
            for place in group.children:
                self._to_wrench(group, place)

    def _follow(self, place: Place, child: ConnectedModules) -> None:
        """Add the responses of a group and all that it carries to the motion of its base."""
        x = self.relations[child]
        first, count = x.moved
        self.to_motion[place][child] = x.of_units[MOTIONS].part(first)
        for output in child.children:
            A, V = (end.part(first) for end in x.through(output))
            for group, known in self.to_motion[output].items():
                terms = [(by_columns(known, 0, A.size), A), (by_columns(known, A.size, V.size), V)]
                self.to_motion[place][group] = self._product(count, terms, [], self.relations[group].motions)

    def _to_wrench(self, group: ConnectedModules, place: Place) -> None:
        """Add the responses of all groups to a wrench on an output."""
        x, at = self.relations[group], self.relations[group].wrench_at(place)
        out = {group: x.of_units[MOTIONS].part(at)}
        passed = x.of_units[WRENCH].part(at) if group.parent else None
        if passed is not None:
            for other, known in self.to_wrench[group.base].items():
                if other not in group.subtree():
                    size = self.relations[other].motions
                    out[other] = self._product(6, [(by_columns(known, 0, 6), passed)], [], size)
        if passed is not None and group in self.own:
            below = by_columns(self.own[group], 0, 6)
            out[group] = self._product(6, [(below, passed)], [out[group]], x.motions)
        for output in group.children if not x.held else ():
            moved = x.through(output)[0].part(at)
            if passed is not None:
                moved = self._product(6, [(by_columns(self.onwards[output], 0, 6), passed)], [moved], 6)
            if output == place:
                self.motion[place] = moved
            if output != place or len(group.children[place]) > 1:
                for other, known in self.to_motion[output].items():
                    size = self.relations[other].motions
                    out[other] = self._product(6, [(by_columns(known, 0, 6), moved)], [], size)
        self.to_wrench[place] = out

    def _settle(self, group: ConnectedModules) -> None:
        """Add the responses of a group to the wrench on its base, which moves the base."""
        x, below = self.relations[group], self.motion.get(group.base)
        if below is None:
            return
        first = x.moved[0]
        K = by_columns(x.of_units[MOTIONS], first, 6)
        self.own[group] = self._product(6, [(K, below)], [], x.motions)
        for place in group.children:
            over_A = by_columns(x.through(place)[0], first, 6)
            self.onwards[place] = self._product(6, [(over_A, below)], [], 6)

    def _product(self, count: int, terms: Sequence[Term], more: list[Each], size: int) -> Each:
        """Add a sum of products, for all lanes."""
        out = self.writer.each(count, size)
        add_terms(self.writer, count, size, terms, more, out)
        return out


def runs_of(modules: Sequence[ModuleCalls]) -> list[list[ModuleCalls]]:
    """Return each module with loops that moves, and between them those each of whose joints is a motion."""

    def of(calls: ModuleCalls) -> int:
        """Return the number of a module with loops; -1 of others."""
        return -1 if calls.module.mobility == len(calls.module.v_index) else calls.k

    moving = [calls for calls in modules if calls.module.mobility]
    return [list(run) for _, run in groupby(moving, key=of)]
