"""Program of the derivatives of the direct model, from those of the balance of forces that it solves.

At the solution the remaining forces r(q, v, a, tau) vanish, and in each module a = Psi(q) u_dot + a_0(q, v).
Changes of u_dot and of the base's acceleration are eliminated group by group, as the model itself does it:
an input changes the forces and outputs of its own group alone, and through them the wrench on the group's
base and the motion of its outputs. All other groups respond to these (`responses`), so that only the dense
rows that are asked for grow with the square of the number of modules.

Along motions that keep the loops closed this is the derivative of the direct model. Single columns, which
open the loops, may differ from those of its program where a base that moves carries a module with closures in
its core: there the program projects the base's forces by the closures, and r by rigid motion.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from ....spatial import Index
from ...equations.expressions import dot, pack, symbols
from ...equations.request import Request
from ...program import Constants, Own, Program, Shared, Source, Target, Turned
from ..direct import direct_inputs, write_direct_sweeps
from ..inverse import Balance, write_balance
from ..writer import Writer
from .adjoints import DENSE, PART, Adjoints
from .columns import Coordinates, collect, coordinates_of, parameters_of
from .dense import Term, by_columns, copy_columns, matrix, sources_of, sum_of, width_of
from .groups import BASE, Group, groups_of
from .memory import compacted
from .motion import Motion, Motions, rows_of
from .nodes import Joiner
from .relations import Builder, Relations
from .responses import Responses


def direct_derivatives(request: Request) -> Program:
    """Build the program of a and its derivatives "d_q", "d_v", "d_tau", row by row.

    With a moving base "d_base_acceleration" is added, with parameters as inputs "d_parameters".
    """
    robot = request.robot
    inputs = direct_inputs(request)
    widths = {name: robot.nv if name == "q" else size for name, size in inputs}
    outputs = [("a", robot.nv)] + [(f"d_{name}", robot.nv * width) for name, width in widths.items()]
    w = Writer("ddm_jacobian", inputs, outputs, computed=("a",))
    modules = write_direct_sweeps(request, w, motions=True)
    start = len(w.steps)
    balance = write_balance(request, w)
    steps = w.calls_from(start)
    groups = groups_of(request, balance)
    live = {("given", k) for k in range(sum(size for _, size in w.inputs))}
    live |= {("result", k) for k in range(robot.nv)}
    motions = Motions(w)
    builder = Builder(w, steps, live, motions)
    moving = {group: motions.of([modules[x.k] for x in group.modules], group.at) for group in groups}
    relations: dict[Group, Relations] = {}
    bodies = {f"parameters {i}": index for i, index in enumerate(parameters_of(request))}
    for group in reversed(groups):
        columns = {"q": group.at.v, "v": group.at.v, "tau": group.motors} | bodies
        columns = {name: index for name, index in columns.items() if len(index)}
        relations[group] = builder.of(group, moving[group], columns, relations)
    relations = dict(reversed(relations.items()))
    results = _Results(w, widths, relations, Responses(w, relations))
    if balance.root is not None:
        results.add_base(balance, coordinates_of(robot)[0])
    for group in groups:
        for name in ("q", "v", "tau"):
            if name in relations[group].inputs:
                results.add(name, relations[group].inputs[name], [results.caused(relations[group], name)])
    for name, index in bodies.items():
        causes = [results.caused(x, name) for x in relations.values() if name in x.inputs]
        results.add(name, index, causes)
    return compacted(w.program())


@dataclass
class _Cause:
    """What a change of an input causes, one column in each lane.

    Attributes:
        group: The group that reads the input; None for a base whose motion is given.
        motions: Motions of the group, without those that the wrench on its base causes.
        wrench: Change of the wrench on its base; None if there is none.
        outputs: Changes of acceleration and twist of its outputs; the twist is None where it stays.
        more: Further changes of the group's accelerations, and how many numbers they have.
    """

    group: Group | None
    motions: Own | None = None
    wrench: Own | None = None
    outputs: dict[tuple[int, int], tuple[Source, Source | None]] = field(default_factory=dict)
    more: Source | None = None


class _Results:
    """Add the derivatives to the results: for each input the columns of each group's accelerations."""

    def __init__(
        self, w: Writer, widths: dict[str, int], relations: dict[Group, Relations], responses: Responses
    ) -> None:
        self._w, self._widths, self._relations, self._responses = w, widths, relations, responses
        self._base: Coordinates | None = None

    def caused(self, x: Relations, name: str) -> _Cause:
        """Add what an input of a group causes."""
        w, group, count = self._w, x.group, len(x.inputs[name])
        motions, wrench = w.own(count, group.mobility), w.own(count, 6) if x.wrenches else None
        right = Turned(x.forces[name].start, x.forces[name].size, x.elimination.rows)
        if x.elimination.rows:
            x.elimination.columns(w, count, right, motions, wrench)
        out = _Cause(group, motions, wrench)
        if name in ("q", "v"):
            over, changed = x.motion.over_q if name == "q" else x.motion.over_v
            if changed.any():
                out.more = Turned(over.start, count, len(group.at.v))
        if group.children:
            self._outputs(x, name, out)
        return out

    def _outputs(self, x: Relations, name: str, out: _Cause) -> None:
        """Add the changes of a group's outputs."""
        w, group, count = self._w, x.group, len(x.inputs[name])
        sizes = [(A.size, V.size) for A, V, _ in map(group.output, group.children)]
        total, n = sum(map(sum, sizes)), group.mobility
        pattern = rows_of(x.patterns.get(name, np.zeros((total, 0), dtype=bool)))
        over_u = x.patterns["u"]
        own: list[Source] = [Turned(x.outputs[name].start, count, total)] if pattern.any() else []
        sources: list[Source] = [Shared(x.S_u.start, total * n), *own]
        assert out.motions is not None
        sources.append(out.motions)
        passed = out.wrench is not None and group in self._responses.own
        if passed and out.wrench is not None:
            sources.append(out.wrench)
            sources += [by_columns(self._responses.onwards[place], 0, 6) for place in group.children]
        targets: list[Target] = []
        first, twists = 0, []
        for place, (a, v) in zip(group.children, sizes, strict=True):
            moves = bool(pattern[first + a : first + a + v].any())
            A, V = w.own(count, a), w.own(count, v) if moves else None
            out.outputs[place] = A, V
            targets += [A, *([V] if V else [])]
            twists.append(moves)
            first += a + v

        def function() -> ca.Function:
            """Return the outputs' changes of one column."""
            kept, S = matrix("S", total, n)
            columns, s = [kept], np.zeros(total).astype(object)
            if own:
                column, entries = symbols("s", total)
                columns.append(column)
                s = np.where(pattern, entries, 0.0)
            column, u = symbols("u", n)
            columns.append(column)
            s = s + dot(np.where(over_u, S, 0.0), u)
            if passed:
                column, wrench = symbols("wrench", 6)
                columns.append(column)
            parts, first = [], 0
            for (a, v), moves in zip(sizes, twists, strict=True):
                A = s[first : first + a]
                if passed:
                    column, onto = matrix("onto", 6, 6)
                    columns.append(column)
                    A = A + dot(onto.T, wrench)
                parts += [A, *([s[first + a : first + a + v]] if moves else [])]
                first += a + v
            return ca.Function("outputs", columns, [pack(part) for part in parts])

        key = ("outputs", tuple(sizes), n, pattern.tobytes(), over_u.tobytes(), passed, bool(own))
        w.call(w.kernel(key, function, PART), count, sources, targets)

    def add_base(self, balance: Balance, at: Coordinates) -> None:
        """Add the columns of a base whose motion is given."""
        w = self._w
        self._base = at
        assert balance.root is not None
        live = {("given", k) for k in range(sum(size for _, size in w.inputs))}
        live |= {("result", int(k)) for k in at.v}
        nodes = Joiner(w.kernels, w.handed).nodes(balance.root_calls)
        found: dict[str, list[Source]] = {"q": [], "v": [], "base_acceleration": []}
        for end in reversed(balance.root):
            assert isinstance(end, Shared)
            adjoints = Adjoints(w, end.size)
            adjoints.seed(end)
            adjoints.sweep(nodes, set(live))
            for name in found:
                rows = w.own(end.size, len(at.v))
                given, index = ("q", at.q) if name == "q" else ("v" if name == "v" else "a", at.v)
                collect(adjoints, given, index, [rows], at if name == "q" else None)
                found[name].append(Turned(rows.start, rows.size, end.size))
        for name, (A, V) in found.items():
            index = np.arange(6) if name == "base_acceleration" else at.v
            self.add(name, index, [_Cause(None, outputs={BASE: (A, V)})])

    def add(self, name: str, index: Index, causes: list[_Cause]) -> None:
        """Add columns of the derivatives of all accelerations.

        Args:
            name: The input; a number may follow the user input's name.
            index: Indices of the columns in the user input.
            causes: What the input causes, for each group that reads it.
        """
        name = name.split()[0]

        def place(rows: Index) -> Target:
            """Return the place of some rows of the columns."""
            return self._w.result(f"d_{name}", rows * self._widths[name] + index[:, None])

        if self._base is not None:
            one = name == "base_acceleration"
            values = np.eye(6) if one else np.zeros((len(index), 6))
            copy_columns(self._w, len(values), Constants(values), place(self._base.v))
        for group, x in self._relations.items():
            self._add_to(x.motion, group, len(index), causes, place(group.at.v))

    def _add_to(self, motion: Motion, group: Group, count: int, causes: list[_Cause], place: Target) -> None:
        """Add the columns of one group's accelerations."""
        w, n, Psi = self._w, group.mobility, motion.Psi
        terms: list[Term] = []
        motions: list[Source] = []
        more: list[Source] = []
        for cause in causes:
            terms += self._terms(cause, group)
            if cause.group is group:
                motions += [cause.motions] if cause.motions and n else []
                more += [cause.more] if cause.more else []
        if not n or not (terms or motions):
            terms, motions = [], []
        if not (terms or motions or more):
            copy_columns(w, count, Constants(np.zeros((count, len(group.at.v)))), place)
            return
        sizes = tuple((term.matrix.size // term.size, term.size) for term in terms)
        pattern = Psi.pattern if terms or motions else np.zeros((len(group.at.v), 0), dtype=bool)
        assert pattern is not None

        def function() -> ca.Function:
            """Return one column of accelerations."""
            u, columns = sum_of(sizes, pattern.shape[1], len(motions))
            kept, entries = matrix("Psi", *pattern.shape)
            a = dot(np.where(pattern, entries, 0.0), u)
            columns.append(kept)
            for _ in more:
                column, y = symbols("more", len(a))
                a = a + y
                columns.append(column)
            return ca.Function("accelerations", columns, [pack(a)])

        key = ("accelerations", sizes, pattern.shape, pattern.tobytes(), len(motions), len(more))
        matrix_of = Shared(Psi.all.start, pattern.size)
        w.call(
            w.kernel(key, function, DENSE), count, [*sources_of(terms), *motions, matrix_of, *more], [place]
        )

    def _terms(self, cause: _Cause, group: Group) -> list[Term]:
        """Return the motions of a group that a cause in another, or at its own base, brings about."""
        responses = self._responses
        for output, (A, V) in cause.outputs.items():
            if group in responses.to_motion[output]:
                known = responses.to_motion[output][group]
                size = width_of(V)
                twist = [Term(by_columns(known, 6, size), V, size)] if V else []
                return [Term(by_columns(known, 0, 6), A, 6), *twist]
        if cause.group is None or cause.wrench is None:
            return []
        if cause.group is group:
            found = responses.own.get(group)
        else:
            found = responses.to_wrench.get(cause.group.base, {}).get(group)
        return [Term(by_columns(found, 0, 6), cause.wrench, 6)] if found else []
