"""Forces of one group along its motors, and the wrench on its base, over what moves or loads the group.

Columns are changes of the motors' positions, rates and accelerations, accelerations and twists of the base,
and wrenches on the outputs. What an output carries adds W = H [A_o; V_o] to the wrench on it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

from ....spatial import Index
from ...equations.expressions import dot, pack, symbols
from ...program import Call, Constants, Each, Shared, Source, Target
from ..writer import Writer
from .adjoints import PART
from .dense import matrix
from .groups import Group, Place
from .motor_motion import Block, MotorMotion
from .nodes import Joiner, numbers_of
from .rows import filled
from .tangents import Graph, Known, Tangents

#: Targets of columns: "motors" are forces along the motors, "base" the wrench on the base, "both" these one
#: after the other, "outputs" accelerations and twists of all outputs one after the other, "accelerations"
#: these alone, "A 0" and "V 0" those of the first output.
Targets = dict[str, Target]


@dataclass
class GroupForces:
    """Forces of one group.

    Attributes:
        writer: The program under construction.
        group: The group.
        parts: Motion of its modules over their motors.
        H: For each output the wrenches that groups on it need over its motion, column by column.
        graph: What leads to them and to the outputs' motion.
        onto: Forces "both", "motors" and "base" over a unit wrench on each output, column by column.
    """

    writer: Writer
    group: Group
    parts: list[MotorMotion]
    H: dict[Place, list[Shared]]
    graph: Graph
    onto: dict[Place, dict[str, Each]] = field(default_factory=dict)
    _known: Known = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Add the forces over wrenches on the outputs."""
        n, rows = self.group.mobility, self.rows
        for place in self.group.children:
            sizes = {"both": rows, "motors": n, "base": rows - n}
            onto = {name: self.writer.each(6, size) for name, size in sizes.items() if size}
            self.columns([(self.group.output(place)[2], Constants(np.eye(6)))], 6, dict(onto))
            self.onto[place] = onto

    @classmethod
    def of(
        cls,
        w: Writer,
        group: Group,
        parts: list[MotorMotion],
        steps: Sequence[Call],
        joiner: Joiner,
        H: dict[Place, list[Shared]],
    ) -> GroupForces:
        """Prepare the forces of a group among the calls of a balance."""
        calls = {id(call) for member in group.modules for call in member.calls}
        nodes = joiner.nodes(call for call in steps if id(call) in calls)
        inputs: list[Source] = [w.from_given("q", group.at.q)]
        inputs += [w.from_given(name, group.at.v) for name in ("v", "a")]
        inputs += [*group.moved(), *(group.output(place)[2] for place in group.children)]
        return cls(w, group, parts, H, Graph.between(nodes, inputs, _results(group)))

    @property
    def moved(self) -> list[Shared]:
        """Acceleration and twist of its base; none on the robot's base."""
        return [end for end in self.group.moved() if isinstance(end, Shared)] if self.group.parent else []

    @property
    def rows(self) -> int:
        """Number of its motors, and six if there is a wrench on its base."""
        return self.group.mobility + (6 if self.group.parent else 0)

    @property
    def motors(self) -> Index:
        """Indices of its motors in tau, in the order of "motors"."""
        return np.concatenate([part.motors for part in self.parts])

    @property
    def places(self) -> list[tuple[Place, int, int]]:
        """Its outputs, and the sizes of their accelerations and twists."""
        outputs = {place: self.group.output(place) for place in self.group.children}
        return [(place, A.size, V.size) for place, (A, V, _) in outputs.items()]

    @property
    def sizes(self) -> list[int]:
        """Sizes of the outputs' accelerations and twists, in the order of "outputs"."""
        return [size for _, *sizes in self.places for size in sizes]

    def over_motors(self, i: int, name: str, targets: Targets) -> None:
        """Add the columns of the motors of part i: of their positions "q", rates "v" or accelerations "a"."""
        part = self.parts[i]
        index = {"q": part.at.q, "v": part.at.v, "a": part.at.v}
        seeds = [
            (self.writer.from_given(x, index[x] if x == name else part.rest), block)
            for x, block in part.over[name].items()
        ]
        self.columns(seeds, len(part.motors), targets)

    def columns(self, seeds: Sequence[tuple[Source, Block]], count: int, targets: Targets) -> None:
        """Add columns, from the changes that they are."""
        w, group = self.writer, self.group
        tangents = Tangents(w, count, self._known)
        for source, block in seeds:
            tangents.seed(source, block)
        onwards = set(targets) <= {"outputs", "accelerations"}
        tangents.sweep(self.graph, self.graph.towards(_outputs(group)) if onwards else None)
        reading = tangents.reading([x for end in _results(group) for x in numbers_of(end, 0)])
        factors = [(part.left, part.factors) for part in self.parts]
        onto = self.onto
        carried = {place: tuple(H.size // 6 for H in self.H[place]) for place in onto}
        names = list(targets)
        n, rows, sizes = group.mobility, self.rows, self.sizes
        moves = any(reading.pattern[rows:])

        def function() -> ca.Function:
            """Return one column."""
            columns, values = reading.symbols()
            x = filled(values)
            forces, moved = x[:rows].copy(), x[rows:]
            along = []
            for at, of in factors:
                part = forces[at]
                if of is not None:
                    column, numbers = symbols("LU", len(at) ** 2)
                    columns.append(column)
                    part = of.solve(numbers, part)
                along.append(part)
            forces[:n] = np.concatenate(along)
            parts = np.split(moved, np.cumsum(sizes)[:-1])
            motions = dict(zip(onto, zip(parts[::2], parts[1::2], strict=False), strict=False))
            for place, widths in carried.items() if moves else ():
                wrench: Any = np.zeros(6).astype(object)
                for width in widths:
                    column, entries = matrix("H", width, 6)
                    columns.append(column)
                    wrench = wrench + dot(entries.T, np.concatenate(motions[place]))
                column, entries = matrix("onto", 6, rows)
                columns.append(column)
                forces = forces + dot(entries.T, wrench)
            stored = {"motors": forces[:n], "base": forces[n:], "both": forces, "outputs": moved}
            stored["accelerations"] = np.concatenate([x[:0], *parts[::2]])
            stored |= {f"A {k}": A for k, A in enumerate(parts[::2])}
            stored |= {f"V {k}": V for k, V in enumerate(parts[1::2])}
            return ca.Function("forces", columns, [pack(stored[name]) for name in names])

        sources: list[Source] = [*reading.blocks]
        sources += [of.numbers for _, of in factors if of is not None]
        for place in onto if moves else ():
            sources += [*self.H[place], Shared(onto[place]["both"].start, 6 * rows)]
        shape = tuple((tuple(at.tolist()), of.pivots if of else None) for at, of in factors)
        key = ("forces", reading.key, shape, rows, tuple(sizes), tuple(carried.values()), tuple(names))
        w.call(w.kernel(key, function, PART), count, sources, list(targets.values()))


def _results(group: Group) -> list[Source | Target]:
    """Return what is left of a group's forces, the wrench on its base, and its outputs' motion."""
    left: list[Source | Target] = [member.left for member in group.modules if member.left is not None]
    base = group.modules[0].F_base if group.parent else None
    return [*left, *([base] if base else []), *_outputs(group)]


def _outputs(group: Group) -> list[Source | Target]:
    """Return accelerations and twists of a group's outputs."""
    return [end for place in group.children for end in group.output(place)[:2]]


def outputs_of(ends: Sequence[tuple[Target, Target]]) -> Targets:
    """Return targets of acceleration and twist of each output by name."""
    return {f"{name} {k}": end for k, pair in enumerate(ends) for name, end in zip("AV", pair, strict=True)}


def columns_from(block: Each, first: int) -> Each:
    """Return a matrix, stored column by column, from one of its columns on."""
    return Each(block.start + first * block.size, block.size)
