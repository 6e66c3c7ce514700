"""Linear relations of one group between changes of its inputs, motions, outputs and wrenches.

With x a column of changes, u_x the change of the group's motions, and A, V and W those of acceleration and
twist of its base and of the wrenches on its outputs,

    [r; F]_x = R_u u_x + R_x      forces left along the motions, zero in all, and the wrench on the base
    [A; V]_x = S_u u_x + S_x      each output
    a_x = Psi u_x + a_x'          accelerations
    W_x = H [A; V]_x              what the outputs carry, which is put into R_x

Modules whose motions are eliminated together are a group, as one module of the recursion.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import casadi as ca
import numpy as np

from ....spatial import Index, Mask
from ....symbols import Expression, dot
from ...equations.expressions import pack
from ...program import Constants, Each, Own, Shared, Source, Target
from ..module_calls import ModuleCalls
from ..writer import Writer
from .columns import by_columns, factors, matrix, solved
from .connected import JOINED, ConnectedModules, Place
from .matrix_names import FACTORS, FORCES, MORE, MOTIONS, OVER_U, WRENCH, MatrixName, S
from .motor_motion import MotorMotion, motions_at
from .sweeps import PART, Block, ProgramGraph, Reading, Sweep


class Relations:
    """Relations of one group, its motions eliminated.

    Over joints, its motions are those along its modules' motions; over motors they are the accelerations of
    the motors. With held motors, efforts of the motors take their place.

    Attributes:
        motions: Number of its motions.
        unit: Number of unit columns: wrenches on its outputs, then accelerations and twists of its base.
        of_units: What they cause, one column after the other: MOTIONS, WRENCH on the base if the group has
            one, and "A" and "V" of its outputs.
        Psi: Accelerations over the motions.
    """

    def __init__(
        self,
        writer: Writer,
        group: ConnectedModules,
        graphs: tuple[ProgramGraph, ProgramGraph],
        runs: list[list[ModuleCalls]],
        a: Source,
        carried: dict[Place, list[Shared]],
        parts: list[MotorMotion],
    ) -> None:
        """Add the relations.

        Args:
            writer: The program under construction.
            group: The group.
            graphs: What leads to its accelerations, and from these to the forces left.
            runs: Calls of its modules that move; each run has columns of its own.
            a: Its accelerations, in the order of its freedoms.
            carried: For each output the wrenches over its motion, of all that it carries.
            parts: How each run follows its motors; none over joints.
        """
        self.writer, self.group, self.held, self.parts = writer, group, group.held, parts
        self._runs, self._graphs, self._carried = runs, graphs, carried
        outputs = [group.output(place) for place in group.children]
        self._sizes = [size for A, V, _ in outputs for size in (A.size, V.size)]
        self._rows = group.mobility + (6 if group.parent else 0)
        names = [MatrixName(x, k) for k in range(len(outputs)) for x in "AV"]
        self.rows = np.concatenate([part.motors for part in parts]) if parts else group.at.v
        self.motions = len(self.rows) if parts else group.mobility
        self._caused = {MOTIONS: self.motions} | ({WRENCH: 6} if group.parent else {})
        self._caused |= dict(zip(names, self._sizes, strict=True))
        at = [x for part in parts for x in part.accelerations] if parts else a.numbers(0)
        self._ends = [x for end in group.results for x in end.numbers(0)] + at
        self._known, self._masks = dict[Any, Any](), dict[MatrixName, Mask]()
        self.onto = {place: writer.each(6, self._rows) for place in group.children}
        wrenches = [self.unit_changes(W) for *_, W in outputs]
        for reading, end in zip(wrenches, self.onto.values(), strict=True):
            self._add(reading, 6, {FORCES: end})
        self._eliminate()
        self._add_units(wrenches)

    def _add_units(self, wrenches: Sequence[Reading]) -> None:
        """Add what unit columns cause, given what reads those of wrenches."""
        columns = [(reading, 6) for reading in wrenches]
        columns += [(self.unit_changes(end), len(end.numbers(0))) for end in self.group.moved()]
        self.unit, first = sum(count for _, count in columns), 0
        self.of_units = {name: self.writer.each(self.unit, size) for name, size in self._caused.items()}
        for reading, count in columns:
            places = {name: x.part(first) for name, x in self.of_units.items()}
            self._add(reading, count, dict(places))
            first += count

    @property
    def pattern(self) -> Mask | None:
        """Which entries of Psi are not always zero; None over motors, where motions are the results."""
        return None if self.parts else self._masks[MORE]

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
        return by_columns(self.of_units[WRENCH], *self.moved)

    def through(self, place: Place) -> tuple[Each, Each]:
        """Return the acceleration and the twist of an output that unit columns cause."""
        k = list(self.group.children).index(place)
        return self.of_units[MatrixName("A", k)], self.of_units[MatrixName("V", k)]

    def reading(self, seeds: Sequence[tuple[Source, Block]], count: int) -> Reading:
        """Add the changes that columns cause at given motions, and return what reads them."""
        tangents = Sweep(self.writer, count, self._known)
        for source, block in seeds:
            tangents.seed(source, block)
        for graph in self._graphs:
            tangents.through(graph)
        return tangents.reading(self._ends)

    def unit_changes(self, source: Source) -> Reading:
        """Add the changes that unit columns of a source cause."""
        size = len(source.numbers(0))
        return self.reading([(source, Constants(np.eye(size)))], size)

    def over_motors(self) -> Iterator[tuple[str, Index, Reading]]:
        """Add the changes over motors; return the names of inputs, their columns, and what reads them."""
        first = 0
        for part in self.parts:
            n, first = len(part.motors), first + part.idle
            if not n:  # all that moves idles
                continue
            part.over_v.through(self._graphs[1])
            yield "q", part.motors, self.reading(part.over_q(), n)
            yield "v", part.motors, part.over_v.reading(self._ends)
            efforts = Sweep(self.writer, n)
            if self.held:
                efforts.seed(part.accelerations, Constants(-np.eye(n)))
            else:
                efforts.seed(self._ends[first : first + n], part.minus_B)
            yield "a" if self.held else "tau", part.motors, efforts.reading(self._ends)
            first += n

    def caused(
        self, reading: Reading, count: int, onwards: Sequence[Shared], motions: Target | None = None
    ) -> dict[MatrixName, Own]:
        """Add what columns cause, one in each lane, and return it by the names of `of_units`.

        Motions are those without what the wrench on the base causes. Twists that stay are left out.

        Args:
            reading: What reads the changes that they cause at given motions.
            count: Number of columns.
            onwards: For each output its acceleration over a wrench on the base, which moves the base.
            motions: Where the motions go; None for a place of their own.
        """
        changed = np.array([bool(parts) for parts in reading.pattern])
        *outputs, a = np.split(changed[self._rows :], np.cumsum(self._sizes, dtype=int))
        stay = {MatrixName("V", k) for k, part in enumerate(outputs[1::2]) if not part.any()}
        wanted = {name: size for name, size in self._caused.items() if name not in stay}
        if not self.parts and a.any():
            wanted[MORE] = len(self.rows)
        ends = {name: self.writer.own(count, size) for name, size in wanted.items()}
        self._add(reading, count, ends | ({MOTIONS: motions} if motions else {}), onwards)
        return ends

    def _eliminate(self) -> None:
        """Add the relations over the motions, module by module, and their factors."""
        w, n, size = self.writer, self.group.mobility, len(self._ends) - self._rows - sum(self._sizes)
        blocks = w.each(n, self._rows), w.each(n, sum(self._sizes[::2])), w.each(n, size)
        self._over_u, self._S, self.Psi = blocks
        self._factors = w.shared(n * (n + 1) // 2)
        first, filled = 0, [tuple(np.zeros((0, x.size), dtype=bool) for x in blocks)]
        for i, modules in enumerate(self._runs):
            u = [x for calls in modules for x in motions_at(calls, "u_dot", held=self.held).numbers(0)]
            idle = u[: 0 if self.held or len(u) <= JOINED else modules[0].idle]
            for own in filter(None, (idle, u[len(idle) :])):  # apart: idle motions change little
                over_u = Sweep(w, len(own), self._known)
                over_u.seed(own, Constants(np.eye(len(own))))
                over_u.through(self._graphs[0])
                if self.parts and own is not idle:
                    self.parts[i].close(over_u, self._graphs[0])
                over_u.through(self._graphs[1])
                targets = dict(zip((FORCES, S, MORE), [x.part(first) for x in blocks], strict=True))
                self._add(over_u.reading(self._ends), len(own), dict(targets))
                filled.append(self._patterns(over_u))
                first += len(own)
        all = map(np.concatenate, zip(*filled, strict=True))
        self._masks = dict(zip((OVER_U, S, MORE), all, strict=True))
        if n and not self.held:
            mask = self._masks[OVER_U][:, :n]
            kernel = w.kernel(("pivot", mask.tobytes(), self._rows), lambda: factors(mask, self._rows), PART)
            w.call(kernel, 1, [Shared(self._over_u.start, n * self._rows)], [self._factors])

    def _patterns(self, over_u: Sweep) -> tuple[Mask, ...]:
        """Return which entries of OVER_U, S and MORE a sweep over motions may fill; one row for each."""
        forces, *moved = np.split(over_u.pattern(self._ends), np.cumsum([self._rows, *self._sizes]), axis=1)
        for output in moved[:-1]:  # what it carries answers
            forces = forces | output.any(axis=1, keepdims=True)
        return forces, np.concatenate([forces[:, :0], *moved[:-1:2]], axis=1), moved[-1]

    def _add(
        self, reading: Reading, count: int, targets: dict[MatrixName, Target], onwards: Sequence[Shared] = ()
    ) -> None:
        """Add the call that computes what columns cause; FORCES and S are those at given motions."""
        w, given = self.writer, self._given(reading, FORCES in targets)
        given |= {MatrixName("onwards", k): (end, 6, 6) for k, end in enumerate(onwards)}

        def function() -> ca.Function:
            """Return one column."""
            columns, values = reading.symbols()
            read = {name: matrix("given", *shape) for name, (_, *shape) in given.items()}
            stored = self._column(
                np.array(values, dtype=object), {name: entries for name, (_, entries) in read.items()}
            )
            columns += [column for column, _ in read.values()]
            return ca.Function("relations", columns, [pack(stored[name]) for name in targets])

        shapes = tuple((name, *shape) for name, (_, *shape) in given.items())
        parts = tuple((len(part.motors), part.idle) for part in self.parts)
        masks = tuple(mask.tobytes() for mask in self._masks.values())
        mode = self.held, parts, self.group.mobility, self._rows, tuple(self._sizes), masks
        kernel = w.kernel(("relations", reading.key, shapes, mode, tuple(targets)), function, PART)
        w.call(kernel, count, [*reading.blocks, *(end for end, *_ in given.values())], list(targets.values()))

    def _given(self, reading: Reading, raw: bool) -> dict[MatrixName, tuple[Source, int, int]]:
        """Return the matrices that a call reads, with their numbers of rows and columns."""
        n, rows, last = self.group.mobility, self._rows, self._rows + sum(self._sizes)
        given: dict[MatrixName, tuple[Source, int, int]] = {}
        for k, (place, onto) in enumerate(self.onto.items() if any(reading.pattern[rows:last]) else ()):
            given |= {MatrixName("H", k, i): (H, H.size // 6, 6) for i, H in enumerate(self._carried[place])}
            given[MatrixName("onto", k)] = Shared(onto.start, 6 * rows), 6, rows
        if raw or not n:
            return given
        ends = {OVER_U: self._over_u, S: self._S} if not self.held or any(reading.pattern[last:]) else {}
        for k, part in enumerate(self.parts):
            if part.inverse and part.Psi:
                name, end = ("inverse", part.inverse) if self.held else ("Psi", part.Psi)
                given[MatrixName(name, k)] = end, len(part.motors), len(part.motors)
        if not self.held:
            given[FACTORS] = self._factors, 1, self._factors.size
        return given | {name: (Shared(x.start, n * x.size), n, x.size) for name, x in ends.items()}

    def _column(self, x: Expression, given: dict[MatrixName, Expression]) -> dict[MatrixName, Expression]:
        """Return what one column causes, from its changes at given motions and the matrices that are read."""
        n, rows, sizes = self.group.mobility, self._rows, self._sizes
        forces, a = x[:rows], x[rows + sum(sizes) :]
        moved = np.split(x[rows:], np.cumsum(sizes))[:-1]
        for k in range(len(self.onto)):
            wrenches = [H for name, H in given.items() if name[:2] == ("H", k)]
            if wrenches:
                wrench = dot(sum(wrenches[1:], wrenches[0]).T, np.concatenate(moved[2 * k : 2 * k + 2]))
                forces = forces + dot(given[MatrixName("onto", k)].T, wrench)
        given = {
            name: np.where(self._masks[name], x, 0.0) if name in (OVER_U, S) else x
            for name, x in given.items()
        }
        out = {FORCES: forces, S: np.concatenate([x[:0], *moved[::2]]), MORE: a}
        u: Any = np.zeros(n).astype(object)
        if FACTORS in given:
            u = solved(given[FACTORS][0], self._masks[OVER_U][:, :n], forces[:n])
        elif OVER_U in given:
            u = -self._mapped(given, "inverse", a, turned=True)
        if OVER_U in given:
            forces = forces + dot(given[OVER_U].T, u)
            ends = np.split(dot(given[S].T, u), np.cumsum(sizes[::2]))
            moved[::2] = [A + more for A, more in zip(moved[::2], ends, strict=False)]
        motions = u
        if self.held:
            motions = self._mapped(given, "inverse", forces)
        elif self.parts and FACTORS in given:
            motions = self._mapped(given, "Psi", u[self._driven()], turned=True) + a
        out |= {MOTIONS: motions, WRENCH: forces[n:]}
        for k, A in enumerate(moved[::2]):
            own = MatrixName("onwards", k)
            onwards = dot(given[own].T, forces[n:]) if own in given else 0.0
            out |= {MatrixName("A", k): A + onwards, MatrixName("V", k): moved[2 * k + 1]}
        return out

    def _driven(self) -> list[int]:
        """Return the numbers of the motions that are not idle, over motors."""
        every = [idle for part in self.parts for idle in [True] * part.idle + [False] * len(part.motors)]
        return [k for k, idle in enumerate(every) if not idle]

    def _mapped(
        self, given: dict[MatrixName, Expression], name: str, x: Expression, *, turned: bool = False
    ) -> Expression:
        """Return matrices of the runs times x; where each joint has a motor, they are the identity."""
        first, out = 0, x.copy()[: self.motions]
        for k, part in enumerate(self.parts):
            own = slice(first, first + len(part.motors))
            first = own.stop
            if (key := MatrixName(name, k)) in given:
                block = given[key]
                out[own] = dot(block.T if turned else block, x[own])
        return out
