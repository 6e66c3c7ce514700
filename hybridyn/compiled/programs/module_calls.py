"""Calls of one module in a program: sources of its inputs and targets of its outputs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ...structure.module import Module
from ..equations.module_graph import WrittenModule
from ..equations.options import ModuleOptions
from ..equations.parts import Leg
from ..equations.request import Request
from ..program import Add, Shared, Source, Target, Worst
from .stage_calls import Stages
from .writer import Writer


@dataclass
class ModuleCalls:
    """Calls of one module in a program.

    Attributes:
        request: The robot and its effects.
        writer: The program under construction.
        k: Index of the module.
        options: Options that its code depends on.
        written: Its code.
        below: The module that carries it, None for a module on the robot's base.
        root: Twist and acceleration of the robot's base if it moves, else None.
        V, A: Twist and acceleration of its outputs that carry modules, by output.
        platforms: Motion of its platforms, by link of the core.
        sums: Sums over the legs of a platform, by the platform's link and by name.
    """

    request: Request
    writer: Writer
    k: int
    options: ModuleOptions
    written: WrittenModule
    stages: Stages
    below: ModuleCalls | None
    root: tuple[Source, Source] | None
    V: dict[int, Shared] = field(default_factory=dict)
    A: dict[int, Shared] = field(default_factory=dict)
    platforms: dict[int, Shared] = field(default_factory=dict)
    sums: dict[tuple[int, str], Add] = field(default_factory=dict)

    @cached_property
    def module(self) -> Module:
        """The module."""
        return self.request.robot.modules[self.k]

    @property
    def groups(self) -> tuple[tuple[Leg, ...], ...]:
        """Its groups of equal legs."""
        return self.request.plans[self.k].parts.groups

    def sources(self) -> dict[str, Source]:
        """Return the sources of positions, rates, parameters and base motion for its stages."""
        out = self._coordinates([self.written])
        if self.request.plans[self.k].column is not None:
            index = self.request.parameter_index(self.k)
            out["parameters"] = self.writer.from_given("parameters", index)
        return out | self._base()

    def leg_sources(self, group: tuple[Leg, ...], numbers: Source) -> dict[str, Source]:
        """Return the sources of positions, rates, own numbers, platform and base motion for equal legs."""
        platform = self.platforms[group[0].platform]
        return self._coordinates(group) | self._base() | {"numbers": numbers, "platform": platform}

    def _coordinates(self, readers: Sequence[WrittenModule | Leg]) -> dict[str, Source]:
        """Return sources of positions, rates and, if they are inputs, accelerations for equal readers."""
        w = self.writer
        q = self.module.q_index[np.array([reader.q for reader in readers])]
        v = self.module.v_index[np.array([reader.v for reader in readers])]
        out: dict[str, Source] = {"q": w.from_given("q", q), "v": w.from_given("v", v)}
        return out | ({"a": w.from_given("a", v)} if "a" in w.given or "a" in w.computed else {})

    def _base(self) -> dict[str, Source]:
        """Return the sources of the base's twist and acceleration that are known so far."""
        if self.below is None:
            return {} if self.root is None else {"V_base": self.root[0], "A_base": self.root[1]}
        known = {"V_base": self.below.V, "A_base": self.below.A}
        output = self.module.parent_output
        return {name: places[output] for name, places in known.items() if output in places}

    def place_platforms(self, size: int) -> dict[str, Target]:
        """Allocate shared numbers for the motion of each platform and return them as targets."""
        self.platforms = {i: self.writer.shared(size) for i in self.written.platforms}
        return {f"platform {i}": place for i, place in self.platforms.items()}

    def sums_of(self, platform: int, parts: tuple[tuple[str, int], ...]) -> dict[str, Target]:
        """Return the targets of a platform's sums over its legs, which start at zero, and of their guards."""
        for name, size in parts:
            if (platform, name) not in self.sums:
                self.sums[platform, name] = self.writer.start(self.writer.shared(size), np.zeros(size))
        targets: dict[str, Target] = {name: self.sums[platform, name] for name, _ in parts}
        return targets | {"guard": Worst()}

    def summed(self) -> dict[str, Source]:
        """Return the sums over the legs of every platform as sources."""
        return {f"{name} {i}": read(place) for (i, name), place in self.sums.items()}


def read(place: Add) -> Shared:
    """Return the source that reads a sum."""
    return Shared(place.start, place.size)
