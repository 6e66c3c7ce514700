"""Linear relations of one group between changes of its inputs, motions, outputs and wrenches.

With x an input, u_x the change of the group's motions, and A, V and W those of acceleration and twist of its
base and of the wrenches on its outputs,

    [0; F_x] = R_u u_x + R_A A_x + R_V V_x + R_W W_x + R_x      remaining forces and the wrench on the base
    [A_o; V_o]_x = S_u u_x + S_A A_x + S_V V_x + S_x            each output
    W_x = H [A_o; V_o]_x + beta_x                               what the output carries

What an output carries is put into R: R_y + R_W H S_y for each y but W (`rows`).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from ....spatial import Index
from ...equations.expressions import dot, pack, symbols
from ...program import Call, Each, Own, Shared, Target, Turned
from ..writer import Writer
from .adjoints import PART, Adjoints, Parts, Pattern
from .dense import Elimination, by_columns, matrix
from .groups import Group, Place
from .motion import Motion, Motions
from .nodes import Joiner, Node, Number, numbers_of
from .rows import Rows

#: Inputs by name, each with the indices of its columns in the user's input.
Columns = dict[str, Index]


@dataclass(kw_only=True)
class Eliminated:
    """What unit columns on a group cause, its motions eliminated.

    Attributes:
        group: The group.
        elimination: Elimination of the motions.
        unit: Columns of unit wrenches on its outputs, then of accelerations and twists of its base.
        motions: The motions that they cause, one column after the other.
        wrenches: The wrenches on the base that they cause, one column after the other.
        through: Accelerations and twists of each output that they cause, one column after the other.
    """

    group: Group
    elimination: Elimination
    unit: int
    motions: Each
    wrenches: Each | None = None
    through: dict[Place, tuple[Each, Each]] = field(default_factory=dict)

    def wrench_at(self, place: Place) -> int:
        """Return the number of the first unit column of wrenches on an output."""
        return 6 * list(self.group.children).index(place)

    @property
    def moved(self) -> tuple[int, int]:
        """First unit column of its base's motion, and the number of them."""
        first = 6 * len(self.group.children)
        return first, self.unit - first

    @property
    def H(self) -> Shared:
        """The wrench on the base over the base's motion, column by column."""
        assert self.wrenches is not None
        return by_columns(self.wrenches, *self.moved)


@dataclass(kw_only=True)
class Relations(Eliminated):
    """Relations of one group, its motions eliminated.

    Attributes:
        motion: Derivatives of its accelerations.
        inputs: Columns of its inputs.
        forces: R over each input.
        outputs: S over each input that moves an output.
        patterns: Which entries of S over each input are not always zero.
        S_u: S over the motions, row by row.
    """

    motion: Motion
    inputs: Columns
    S_u: Each
    forces: dict[str, Own]
    outputs: dict[str, Own]
    patterns: dict[str, Pattern]


class Builder:
    """Add the relations of groups to a program, inwards."""

    def __init__(self, writer: Writer, steps: list[Call], live: set[Number], motions: Motions) -> None:
        """Prepare the relations.

        Args:
            writer: The program under construction.
            steps: Calls that compute what is left of the forces.
            live: Numbers over which they may be differentiated: user inputs and accelerations.
            motions: Derivatives of accelerations.
        """
        self._w, self._steps, self._live, self._motions = writer, steps, live, motions
        self._joiner = Joiner(writer.kernels, writer.handed)

    def of(self, group: Group, motion: Motion, inputs: Columns, above: dict[Group, Relations]) -> Relations:
        """Add the relations of one group.

        Args:
            group: The group.
            motion: Derivatives of its accelerations.
            inputs: Columns of the inputs; names are those of user inputs, and a number may follow.
            above: Relations of the groups that it carries.
        """
        w, at = self._w, group.at
        calls = {id(call) for member in group.modules for call in member.calls}
        nodes = self._joiner.nodes(call for call in self._steps if id(call) in calls)
        outputs, moved = [group.output(place) for place in group.children], group.moved()
        live = self._live | {x for end in (*moved, *(W for *_, W in outputs)) for x in numbers_of(end, 0)}
        left: list[Target] = [member.left for member in group.modules if member.left is not None]
        wrench = [group.modules[0].F_base] if group.parent else []
        backwards = self._swept(nodes, [*left, *(end for end in wrench if end is not None)], live)
        onwards = self._swept(nodes, [end for A, V, _ in outputs for end in (A, V)], live)
        for adjoints in (backwards, onwards):
            self._motions.through(adjoints, motion.nodes, motion.u_dot, at)

        def parts(adjoints: Adjoints) -> dict[str, list[Parts]]:
            """Return the parts of the adjoints of the inputs that are used, by name."""
            out = {"W": [x for *_, W in outputs for x in adjoints.parts(W)]}
            out["moved"] = [x for end in moved for x in adjoints.parts(end)]
            out["u"] = [x for u in motion.u_dot for x in adjoints.parts(u)]
            for name, index in inputs.items():
                found = adjoints.parts(w.from_given(name.split()[0], at.q if name == "q" else index))
                if name in ("q", "v", "tau") or any(found):
                    out[name] = found
            return out

        carried = [[above[child].H for child in children] for children in group.children.values()]
        rows, sent = Rows(w, group), {}
        if outputs:
            read = parts(onwards)
            sent = rows.add(onwards, {name: read[name] for name in ("W", "moved", "u", "q", "v")}, [], {})
        read = parts(backwards)
        received = rows.add(backwards, read, carried, sent)
        unit = len(read["W"]) + len(read["moved"])
        out = Relations(
            group=group,
            motion=motion,
            inputs={name: inputs[name] for name in received if name in inputs},
            elimination=Elimination.of(w, received["u"].all, backwards.rows),
            S_u=sent["u"].all if sent else Each(0, 0),
            motions=w.each(unit, group.mobility),
            unit=unit,
            forces={name: block.rows for name, block in received.items()},
            outputs={name: block.rows for name, block in sent.items()},
            patterns={name: block.pattern for name, block in sent.items() if block.pattern is not None},
            wrenches=w.each(unit, 6) if group.parent else None,
        )
        if unit and backwards.rows:
            right = Turned(out.forces["unit"].start, unit, backwards.rows)
            out.elimination.columns(w, unit, right, out.motions, out.wrenches)
        if outputs:
            self._through(out)
        return out

    def _swept(self, nodes: list[Node], ends: list[Target], live: set[Number]) -> Adjoints:
        """Return the adjoints of some results, one row for each of their numbers."""
        counts = [len(numbers_of(end, 0)) for end in ends]
        adjoints = Adjoints(self._w, sum(counts), self._motions.known)
        for end, first in zip(ends, np.cumsum([0, *counts]).tolist(), strict=False):
            adjoints.seed(end, first)
        adjoints.sweep(nodes, set(live))
        return adjoints

    def _through(self, x: Relations) -> None:
        """Add the accelerations and twists of outputs that unit columns cause."""
        w, n, places = self._w, x.group.mobility, list(x.group.children)
        sizes = [end.size for place in places for end in x.group.output(place)[:2]]
        ends = [w.each(x.unit, size) for size in sizes]
        x.through = dict(zip(places, zip(ends[::2], ends[1::2], strict=True), strict=True))
        total = sum(sizes)

        def function() -> ca.Function:
            """Return S_u u + S."""
            (kept, S), (u_column, u) = matrix("S", total, n), symbols("u", n)
            column, s = symbols("s", total)
            moved = np.split(s + dot(S, u), np.cumsum(sizes)[:-1])
            return ca.Function("through", [kept, u_column, column], [pack(part) for part in moved])

        kernel = w.kernel(("through", tuple(sizes), n), function, PART)
        own = Turned(x.outputs["unit"].start, x.unit, total)
        w.call(kernel, x.unit, [Shared(x.S_u.start, total * n), x.motions, own], list(ends))
