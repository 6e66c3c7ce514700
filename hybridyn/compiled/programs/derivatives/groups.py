"""Groups of modules whose motions are eliminated together, as one module of the recursion."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ....spatial import Index
from ...equations.request import Request
from ...program import Shared, Source, Target
from ..inverse import InverseCalls
from ..module_calls import read
from .columns import Coordinates, coordinates_of_freedoms

#: Largest number of motions of modules that are joined: what the lanes of a vector hold.
JOINED = 8

#: Output of a module: the module's number and the output's.
Place = tuple[int, int]


@dataclass(eq=False)
class Group:
    """Connected modules.

    Attributes:
        modules: Calls of its modules, outwards.
        parent: The group that carries it; None on the robot's base.
        children: Groups on its outputs, by output.
    """

    modules: list[InverseCalls]
    parent: Group | None
    at: Coordinates
    children: dict[Place, list[Group]] = field(default_factory=dict)

    @property
    def base(self) -> Place:
        """The output that carries it; the number of its module is negative on the robot's base."""
        module = self.modules[0].module
        return module.parent, module.parent_output

    @property
    def mobility(self) -> int:
        """Number of its motions."""
        return sum(calls.module.mobility for calls in self.modules)

    @property
    def motors(self) -> Index:
        """Indices of its motors in tau."""
        return np.concatenate([calls.module.motor_index for calls in self.modules]).astype(int)

    def moved(self) -> list[Source]:
        """Return the sources of its base's acceleration and twist; none on a fixed base."""
        known = self.modules[0].sources()
        return [known[name] for name in ("A_base", "V_base") if name in known]

    def output(self, place: Place) -> tuple[Shared, Shared, Shared]:
        """Return acceleration and twist of an output, and the wrench that its children require."""
        calls = next(calls for calls in self.modules if calls.k == place[0])
        return calls.A[place[1]], calls.V[place[1]], read(calls.received[place[1]])

    @property
    def results(self) -> list[Source | Target]:
        """What is left of its forces, the wrench on its base, and its outputs' accelerations and twists."""
        ends: list[Source | Target | None] = [member.left for member in self.modules]
        ends.append(self.modules[0].F_base if self.parent else None)
        ends += [end for place in self.children for end in self.output(place)[:2]]
        return [end for end in ends if end is not None]

    def subtree(self) -> list[Group]:
        """Return the group and all groups that it carries."""
        return [self, *(x for place in self.children for x in self.on(place))]

    def on(self, place: Place) -> list[Group]:
        """Return all groups that one of its outputs carries."""
        return [x for child in self.children[place] for x in child.subtree()]


def groups_of(request: Request, balance: list[InverseCalls]) -> list[Group]:
    """Join modules to groups, outwards; those without motions join any, so that they are alone on a base."""
    members: list[list[InverseCalls]] = []
    of: dict[int, list[InverseCalls]] = {}
    for calls in balance:
        below, own = of.get(calls.module.parent), calls.module.mobility
        joined = sum(x.module.mobility for x in below or ())
        if below and (not (own and joined) or own + joined <= JOINED):
            below.append(calls)
        else:
            members.append(below := [calls])
        of[calls.k] = below
    groups: list[Group] = []
    by_module: dict[int, Group] = {}
    for modules in members:
        freedoms = {int(k) for calls in modules for k in calls.module.v_index}
        parent = by_module.get(modules[0].module.parent)
        group = Group(modules, parent, coordinates_of_freedoms(request.robot, freedoms))
        groups.append(group)
        by_module |= {calls.k: group for calls in modules}
        if parent:
            parent.children.setdefault(group.base, []).append(group)
    return groups
