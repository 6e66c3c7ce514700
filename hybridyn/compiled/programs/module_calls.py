"""One module's calls in a program: where the numbers come from that it reads, and where its own go."""

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
from ..program import Add, Constants, Shared, Source, Target, Worst
from .stage_calls import Stages
from .writer import Writer


@dataclass
class ModuleCalls:
    """One module in a program.

    Attributes:
        request: The robot and its effects.
        writer: The program.
        k: Number of the module.
        options: What its code depends on.
        written: Its code.
        stages: Calls of its stages.
        below: The module that it stands on, None for the first ones.
        root: Twist and acceleration of a base that moves, where the first ones stand on one.
        V, A: Twist and acceleration of its outputs that carry modules, by output.
        platforms: Motion of its platforms, by link of the core.
        sums: What the legs of a platform add up, by the platform's link and by name.
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
        """Return where its stages find positions, rates, parameters, and the motion of its base."""
        out = self._coordinates([self.written])
        if self.request.parameters:
            index = self.request.parameter_index(self.module)
            out["parameters"] = self.writer.from_given("parameters", index)
        return out | self._base()

    def leg_sources(self, group: tuple[Leg, ...], numbers: Constants) -> dict[str, Source]:
        """Return where equal legs find positions, rates, the numbers they differ in, platform and base."""
        platform = self.platforms[group[0].platform]
        return self._coordinates(group) | self._base() | {"numbers": numbers, "platform": platform}

    def _coordinates(self, readers: Sequence[WrittenModule | Leg]) -> dict[str, Source]:
        """Return positions and rates of equal readers side by side; accelerations where they are given."""
        w = self.writer
        q = self.module.q_index[np.array([reader.q for reader in readers])]
        v = self.module.v_index[np.array([reader.v for reader in readers])]
        out: dict[str, Source] = {"q": w.from_given("q", q), "v": w.from_given("v", v)}
        return out | ({"a": w.from_given("a", v)} if "a" in w.given else {})

    def _base(self) -> dict[str, Source]:
        """Return twist and acceleration of the base, as far as they are known yet."""
        if self.below is None:
            return {} if self.root is None else {"V_base": self.root[0], "A_base": self.root[1]}
        known = {"V_base": self.below.V, "A_base": self.below.A}
        output = self.module.parent_output
        return {name: places[output] for name, places in known.items() if output in places}

    def place_platforms(self, size: int) -> dict[str, Target]:
        """Make room for the motion of each platform, and give it as targets."""
        self.platforms = {i: self.writer.shared(size) for i in self.written.platforms}
        return {f"platform {i}": place for i, place in self.platforms.items()}

    def sums_of(self, platform: int, parts: tuple[tuple[str, int], ...]) -> dict[str, Target]:
        """Return where the legs of a platform add their parts (name and size), zero before the first.

        The legs' guards go with them.
        """
        for name, size in parts:
            if (platform, name) not in self.sums:
                self.sums[platform, name] = self.writer.start(self.writer.shared(size), np.zeros(size))
        targets: dict[str, Target] = {name: self.sums[platform, name] for name, _ in parts}
        return targets | {"guard": Worst()}

    def summed(self) -> dict[str, Source]:
        """Return what the legs of every platform added up."""
        return {f"{name} {i}": read(place) for (i, name), place in self.sums.items()}


def read(place: Add) -> Shared:
    """Return the sum that was added up at a place."""
    return Shared(place.start, place.size)
