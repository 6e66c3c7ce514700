"""Modules whose motions are eliminated together."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import chain

import numpy as np

from ....spatial import Index
from ...equations.request import Request
from ...program import Shared, Source, Target
from ..module_calls import ModuleCalls, read
from .columns import ModuleCoordinates, coordinates_of_freedoms
from .motor_motion import motions_at

#: Output of a module: the module's number and the output's.
Place = tuple[int, int]

#: Largest number of motions of modules that are joined: what the lanes of a vector hold.
JOINED = 8


@dataclass(eq=False)
class ConnectedModules:
    """Connected modules.

    Attributes:
        modules: Calls of its modules, outwards.
        parent: The group that carries it; None on the robot's base.
        at: Its coordinates.
        held: Whether the motors are held, as for `motions_at`.
        children: Groups on its outputs, by output.
    """

    modules: list[ModuleCalls]
    parent: ConnectedModules | None
    at: ModuleCoordinates
    held: bool
    children: dict[Place, list[ConnectedModules]] = field(default_factory=dict)

    @property
    def base(self) -> Place:
        """The output that carries it; the number of its module is negative on the robot's base."""
        module = self.modules[0].module
        return module.parent, module.parent_output

    def along(self, name: str) -> list[Shared]:
        """Return the ports "u_dot" or "Q" of its modules, as `motions_at`."""
        return [motions_at(calls, name, held=self.held) for calls in self.modules]

    @property
    def mobility(self) -> int:
        """Number of its motions."""
        return sum(u_dot.size for u_dot in self.along("u_dot"))

    @property
    def motors(self) -> Index:
        """Indices of its motors in tau."""
        return np.concatenate([calls.module.motor_index for calls in self.modules]).astype(int)

    def moved(self) -> list[Source]:
        """Return the sources of its base's acceleration and twist; none on a fixed base."""
        known = self.modules[0].ports
        return [known[name] for name in ("A_base", "V_base") if name in known]

    def output(self, place: Place) -> tuple[Shared, Shared, Shared]:
        """Return acceleration and twist of an output, and the wrench that its children require."""
        calls = next(calls for calls in self.modules if calls.k == place[0])
        A, V, F = (read(calls.ports[f"{name} {place[1]}"]) for name in "AVF")
        return A, V, F

    @property
    def results(self) -> list[Source | Target]:
        """What is left of its forces, the wrench on its base, and its outputs' accelerations and twists."""
        ends: list[Source | Target] = [*self.along("Q")]
        ends += [self.modules[0].ports["F_base"]] if self.parent else []
        return ends + [end for place in self.children for end in self.output(place)[:2]]

    def subtree(self) -> list[ConnectedModules]:
        """Return the group and all groups that it carries."""
        return [self, *(x for child in chain(*self.children.values()) for x in child.subtree())]


def groups_of(request: Request, balance: list[ModuleCalls], *, held: bool) -> list[ConnectedModules]:
    """Join modules to groups, outwards; those without motions join any, so that they are alone on a base."""
    members: list[list[ModuleCalls]] = []
    of: dict[int, list[ModuleCalls]] = {}
    for calls in balance:
        below, own = of.get(calls.module.parent), calls.module.mobility
        joined = sum(x.module.mobility for x in below or ())
        if below and (not (own and joined) or own + joined <= JOINED):
            below.append(calls)
        else:
            members.append(below := [calls])
        of[calls.k] = below
    groups: list[ConnectedModules] = []
    by_module: dict[int, ConnectedModules] = {}
    for modules in members:
        freedoms = {int(k) for calls in modules for k in calls.module.v_index}
        parent = by_module.get(modules[0].module.parent)
        group = ConnectedModules(modules, parent, coordinates_of_freedoms(request.robot, freedoms), held)
        groups.append(group)
        by_module |= {calls.k: group for calls in modules}
        if parent:
            parent.children.setdefault(group.base, []).append(group)
    return groups
