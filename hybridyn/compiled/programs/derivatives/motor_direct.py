"""Program of the derivatives of motor accelerations over positions, rates and efforts of the motors.

The forces along the motors f(m, m_dot, m_ddot) - tau of all groups (`motor_forces`) vanish; motor
accelerations and the bases' motion are eliminated group by group, as in `direct`.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from ...equations.expressions import dot, pack, symbols
from ...equations.request import Request
from ...program import Constants, Each, Own, Program, Shared, Source, Target
from ..direct import DirectCalls, direct_inputs, write_direct_sweeps
from ..inverse import write_balance
from ..writer import Writer
from .adjoints import PART
from .dense import Elimination, Term, add_terms, by_columns, copy_columns, matrix
from .groups import Group, Place, groups_of
from .memory import compacted
from .motion import Motions
from .motor_forces import GroupForces, columns_from
from .motor_inertias import along_motors
from .motor_legs import sum_legs
from .motor_motion import MotorMotions
from .nodes import Joiner
from .relations import Eliminated
from .responses import Responses

#: Inputs of the derivatives, each with as many columns as there are motors.
INPUTS = ("q", "v", "tau")


def motor_direct_derivatives(request: Request) -> Program:
    """Build the program of a, and of "d_q", "d_v", "d_tau": of motor accelerations over the motors' motion.

    A base that moves keeps its motion.
    """
    robot, motors = request.robot, len(request.robot.motors)
    outputs = [("a", robot.nv)] + [(f"d_{name}", motors * motors) for name in INPUTS]
    w = Writer("ddm_motor_jacobian", direct_inputs(request), outputs, computed=("a",))
    modules = write_direct_sweeps(request, w, motions=True, inertias=True)
    start = len(w.steps)
    balance = write_balance(request, w)
    steps = sum_legs(w, modules, balance, start)
    groups = [
        group for group in groups_of(request, balance) if group.mobility
    ]  # others stand still on the base
    joiner, motions = Joiner(w.kernels, w.handed), MotorMotions(w, Motions(w))
    moving = {group: motions.of([modules[x.k] for x in group.modules]) for group in groups}
    relations: dict[Group, MotorRelations] = {}
    for group in reversed(groups):
        H = {place: [relations[child].H for child in children] for place, children in group.children.items()}
        forces = GroupForces.of(w, group, moving[group], steps, joiner, H)
        relations[group] = MotorRelations.of(forces, [modules[x.k] for x in group.modules])
    relations = dict(reversed(relations.items()))
    results = _Results(w, motors, relations, Responses(w, relations))
    for x in relations.values():
        for name in INPUTS:
            for i in range(len(x.forces.parts)):
                results.add(x, i, name)
    return compacted(w.program())


@dataclass(kw_only=True)
class MotorRelations(Eliminated):
    """Relations of one group, its motor accelerations eliminated.

    Attributes:
        forces: Forces of the group.
        S: Accelerations of the outputs over motor accelerations, column by column.
    """

    forces: GroupForces
    S: Each

    @classmethod
    def of(cls, x: GroupForces, modules: list[DirectCalls]) -> MotorRelations:
        """Add the relations of a group."""
        w, group, n, rows = x.writer, x.group, x.group.mobility, x.rows
        total = sum(x.sizes)
        S, over, onto = w.each(n, 6 * len(x.places)), w.each(rows, n), w.each(6, rows)
        alone = len(modules) == 1
        if alone:
            ends: list[Target] = [Shared(end.start, rows * size) for end, size in ((over, n), (onto, 6))]
            along_motors(w, modules[0], x.parts[0], ends)
            if total:
                x.over_motors(0, "a", {"accelerations": S})
        else:
            _over_accelerations(x, S, over)
        moved = x.moved
        unit = 6 * len(group.children) + sum(end.size for end in moved)
        out = cls(
            group=group,
            elimination=Elimination.of(w, over, rows),
            unit=unit,
            motions=w.each(unit, n),
            wrenches=w.each(unit, 6) if group.parent else None,
            forces=x,
            S=S,
        )
        out.through = {place: (w.each(unit, a), w.each(unit, v)) for place, a, v in x.places}
        for k, place in enumerate(group.children):
            out._unit(x.onto[place]["both"], None, 6 * k, 6)
        at = 6 * len(group.children)
        for end in moved:
            known, received = alone and end == moved[0], w.own(end.size, rows)
            sent = w.own(end.size, total) if total else None
            targets: dict[str, Target] = {} if known else {"both": received}
            if sent:
                targets["outputs"] = sent
            if targets:
                x.columns([(end, Constants(np.eye(end.size)))], end.size, targets)
            out._unit(onto if known else received, sent, at, end.size)
            at += end.size
        return out

    def _unit(self, right: Source, sent: Source | None, first: int, count: int) -> None:
        """Add what some unit columns cause: motions, the wrench on the base, and the outputs' motion."""
        wrenches = None if self.wrenches is None else columns_from(self.wrenches, first)
        motions = columns_from(self.motions, first)
        self.elimination.columns(self.forces.writer, count, right, motions, wrenches)
        ends: list[Target] = [columns_from(end, first) for pair in self.through.values() for end in pair]
        if ends:
            self.moved_outputs(count, motions, sent, ends)

    def moved_outputs(
        self,
        count: int,
        motions: Source,
        sent: Source | None,
        targets: list[Target],
        onto: tuple[Source, ...] = (),
    ) -> None:
        """Add accelerations and twists of the outputs, S u + s.

        Args:
            motions: Columns u.
            sent: Columns s; None if they are zero.
            targets: Targets of acceleration and twist of each output.
            onto: Columns of a wrench on the base, and for each output the acceleration that its unit causes,
                column by column; or nothing.
        """
        w, n, sizes = self.forces.writer, self.group.mobility, self.forces.sizes
        total, places = sum(sizes), len(sizes) // 2

        def function() -> ca.Function:
            """Return one column."""
            (kept, S), (column, u) = matrix("S", n, 6 * places), symbols("u", n)
            columns, s = [kept, column], np.zeros(total).astype(object)
            if sent is not None:
                column, s = symbols("s", total)
                columns.append(column)
            parts = np.split(s, np.cumsum(sizes)[:-1])
            parts[::2] = [x + y for x, y in zip(parts[::2], np.split(dot(S.T, u), places), strict=True)]
            if onto:
                column, wrench = symbols("wrench", 6)
                columns.append(column)
                for k in range(0, len(sizes), 2):
                    column, entries = matrix("onto", 6, 6)
                    columns.append(column)
                    parts[k] = parts[k] + dot(entries.T, wrench)
            return ca.Function("moved", columns, [pack(part) for part in parts])

        key = ("moved by motors", tuple(sizes), n, sent is not None, bool(onto))
        more = [sent] if sent is not None else []
        w.call(
            w.kernel(key, function, PART),
            count,
            [Shared(self.S.start, self.S.size * n), motions, *more, *onto],
            targets,
        )


class _Results:
    """Add the derivatives to the results."""

    def __init__(
        self, w: Writer, motors: int, relations: dict[Group, MotorRelations], responses: Responses
    ) -> None:
        self._w, self._motors, self._relations, self._responses = w, motors, relations, responses

    def add(self, x: MotorRelations, i: int, name: str) -> None:
        """Add the columns of an input of a part's motors to all motor accelerations."""
        w, group, forces = self._w, x.group, x.forces
        own, n, rows = forces.parts[i].motors, group.mobility, forces.rows
        count, sent = len(own), None
        if name == "tau":
            right: Source = Constants(-np.eye(n, rows)[np.isin(forces.motors, own)])
        else:
            right = w.own(count, rows)
            targets: dict[str, Target] = {"both": right}
            if group.children:
                targets["outputs"] = sent = w.own(count, sum(forces.sizes))
            forces.over_motors(i, name, targets)
        motions, wrench = w.own(count, n), w.own(count, 6) if group.parent else None
        x.elimination.columns(w, count, right, motions, wrench)
        outputs: dict[Place, tuple[Own, Own]] = {}
        if group.children and name != "tau":
            ends = [w.own(count, size) for size in forces.sizes]
            outputs = dict(zip(group.children, zip(ends[::2], ends[1::2], strict=True), strict=True))
            onto: tuple[Source, ...] = ()
            if wrench is not None:
                onto = (wrench, *(by_columns(self._responses.onwards[p], 0, 6) for p in group.children))
            x.moved_outputs(count, motions, sent, list(ends), onto)
        groups = list(self._relations)
        if name == "tau":  # symmetric: what it causes outwards of the group is what it causes there
            groups = groups[: groups.index(group) + 1]
        for other in groups:
            terms, moved = self._terms(group, wrench, outputs, other), self._relations[other].forces.motors
            places = [w.result(f"d_{name}", moved * self._motors + own[:, None])]
            if name == "tau" and other is not group:
                places.append(w.result("d_tau", own[:, None] * self._motors + moved))
            caused = [motions] if other is group else []
            if terms:
                add_terms(w, count, terms, caused, *places)
                continue
            for place in places:
                still = Constants(np.zeros((count, len(moved))))
                copy_columns(w, count, motions if caused else still, place)

    def _terms(
        self,
        group: Group,
        wrench: Own | None,
        outputs: dict[Place, tuple[Own, Own]],
        other: Group,
    ) -> list[Term]:
        """Return what an input of a group brings about in another, or in itself through its base."""
        responses = self._responses
        for place, (A, V) in outputs.items():
            if other in responses.to_motion[place]:
                known = responses.to_motion[place][other]
                return [Term(by_columns(known, 0, 6), A, 6), Term(by_columns(known, 6, V.size), V, V.size)]
        if wrench is None:
            return []
        own = other is group
        found = responses.own.get(group) if own else responses.to_wrench[group.base].get(other)
        return [Term(by_columns(found, 0, 6), wrench, 6)] if found else []


def _over_accelerations(x: GroupForces, S: Each, over: Each) -> None:
    """Add forces, row by row, and accelerations of the outputs, column by column, over the motors' own."""
    w, n = x.writer, x.group.mobility
    D, F, first = w.each(n, n), w.each(n, x.rows - n), 0
    for i, part in enumerate(x.parts):
        targets: dict[str, Target] = {"motors": columns_from(D, first)}
        if F.size:
            targets["base"] = columns_from(F, first)
        if S.size:
            targets["accelerations"] = columns_from(S, first)
        x.over_motors(i, "a", targets)
        first += len(part.motors)
    _by_rows(w, D, F, n, over)


def _by_rows(w: Writer, upper: Each, lower: Each, n: int, target: Each) -> None:
    """Add the call that writes two matrices of n columns below each other, row by row."""

    def function() -> ca.Function:
        """Return the rows."""
        (first, A), (second, B) = matrix("A", n, upper.size), matrix("B", n, lower.size)
        return ca.Function("by_rows", [first, second], [pack(np.concatenate([A.T, B.T]).ravel())])

    kernel = w.kernel(("by rows", n, upper.size, lower.size), function, PART)
    sources: list[Source] = [Shared(end.start, n * end.size) for end in (upper, lower)]
    w.call(kernel, 1, sources, [Shared(target.start, n * (upper.size + lower.size))])
