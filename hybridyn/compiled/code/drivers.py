"""Generate the drivers of a program: one whose lanes hold samples, and one whose lanes hold copies.

With samples in the lanes, calls and copies run one after the other; with one lane it is the scalar program
of one sample. With copies in the lanes, one sample computes equal legs in parallel. Numbers that the copies
share are plain numbers. Lanes without a copy repeat the first copy. Sums add the copies in their order, with
the same additions as the other driver. What has one copy runs on plain numbers where there is code for it:
vectors would compute it in all lanes alike, with more memory, and longer divisions and roots. All ways give
the same bits.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from itertools import accumulate
from types import MappingProxyType

import numpy as np

from ...spatial import Index
from ..program import Add, Call, Constants, Each, Own, Program, Shared, Source, Start, Target, Worst
from .c_tables import Tables
from .rules import overlap

#: The C functions that move numbers.
MOVES = "INLINE V worst(V a, V b) { return SELECT(OR(LE(b, a), NE(a, a)), a, b); } /* a NaN stays */\n" + (
    "\n".join(
        f"INLINE void {name}({given}, int n) {{\n    int k;\n    for (k = 0; k < n; k++) {move};\n}}"
        for name, given, move in (
            ("set_all", "V *to, const S *from", "to[k] = C(from[k])"),
            ("copy", "V *to, const V *from", "to[k] = from[k]"),
            ("gather", "V *to, const V *from, const int *at", "to[k] = from[at[k]]"),
            ("scatter", "V *to, const int *at, const V *from", "to[at[k]] = from[k]"),
            ("add", "V *to, const V *from", "to[k] += from[k]"),
        )
    )
)

#: First lines of the drivers.
HEAD = "static void {name}_samples(const V *given, V *result, V *shared, V *own, V *guard)"
COPIES_HEAD = "static void {name}_copies(const S *given, S *result, S *shared, V *own, S *guard) {{"


#: Least share of sums in the instructions of legs whose kernels are compiled a second time to add them in
#: place: 7 % in direct models, whose batches then take a tenth less; 2 % in inverse models.
SUMMED = 0.05


class _CallBlock:
    """C block of one call of a kernel, for one copy after the other, on V or on plain numbers.

    Attributes:
        before: Lines before the call: local vectors, and gathering into them.
        after: Lines after the call: copying from local vectors to their targets.
    """

    head, type, suffix = "{", "V", ""

    def __init__(self, call: Call, tables: Tables, sums: Collection[int] = (), between: str = "") -> None:
        """Prepare a call. `sums`: outputs that the kernel adds in place; `between`: a first statement."""
        self.call, self.tables, self.sums = call, tables, sums
        self.before = [between] if between else []
        self.after: list[str] = []
        if call.copies > 1:
            self.head = f"for (int i = 0; i < {call.copies}; i++) {{"

    def lines(self, kernel: str) -> list[str]:
        """Return the lines of the block.

        An argument without numbers is the null pointer: a local vector would never be set, which compilers
        warn of.
        """
        call = self.call
        arguments = [
            self.source(n, read) if read.at(call.copies).size else "0" for n, read in enumerate(call.sources)
        ]
        for n, (written, free) in enumerate(zip(call.targets, in_place(call), strict=True)):
            size = written.at(call.copies).shape[1]
            arguments.append(self.target(n, written, size, free) if size else self.vector(f"y{n}", 0))
        body = [*self.before, f"{kernel}({', '.join(arguments)});", *self.after]
        return [f"    {self.head}", *(f"        {line}" for line in body), "    }"]

    def vector(self, name: str, size: int) -> str:
        """Declare a local vector and return its name."""
        self.before.append(f"{self.type} {name}[{max(size, 1)}];")
        return name

    def place(self, end: Source | Target) -> str:
        """Return the place of the first of some numbers; plain ones of `own` begin where its vector does."""
        place = f"{end.memory} + {end.begin(self.call.copies, self.tables)}"
        return f"(S *)({place})" if self.type == "S" and end.memory == "own" else place

    def entries(self, index: Index) -> str:
        """Return the places of the copy's numbers."""
        row = f" + i * {index.shape[1]}" if self.call.copies > 1 else ""
        return self.tables.places(index) + row

    def source(self, n: int, source: Source) -> str:
        """Return an argument that is read; entries that are not contiguous are gathered first."""
        if source.handed:
            return self.place(source)
        index = source.at(self.call.copies)
        if isinstance(source, Constants):
            if self.type == "S":
                return self.tables.numbers(source.values)
            row = f" + i * {index.shape[1]}" if self.call.copies > 1 else ""
            move, at = "set_all", f"{self.tables.numbers(source.values)}{row}"
        else:
            move, at = f"gather{self.suffix}", f"{source.memory}, {self.entries(index)}"
        x = self.vector(f"x{n}", index.shape[1])
        self.before.append(f"{move}({x}, {at}, {index.shape[1]});")
        return x

    def target(self, n: int, target: Target, size: int, free: bool) -> str:
        """Return an argument that is written; what cannot be written in place is copied afterwards."""
        y = f"y{n}"
        if isinstance(target, Worst):
            self.after.append(f"*guard = worst{self.suffix and '_number'}(*guard, {y}[0]);")
        elif not target.handed or (target.memory == "result" and not free):
            at = self.entries(target.at(self.call.copies))
            self.after.append(f"scatter{self.suffix}(result, {at}, {y}, {size});")
        elif n in self.sums or (free and not target.adds):
            return self.place(target)
        else:
            move = f"{'add' if target.adds else 'copy'}{self.suffix}"
            self.after.append(f"{move}({self.place(target)}, {y}, {size});")
        return self.vector(y, size)


class _Plain(_CallBlock):
    """C block of a call of one copy, on plain numbers among vectors."""

    type, suffix = "S", "_numbers"


class _Pack(_CallBlock):
    """C block of a call for one pack of copies, as many as there are lanes."""

    def __init__(self, call: Call, tables: Tables, pack: int, lanes: int) -> None:
        super().__init__(call, tables)
        self.head, self.pack, self.first = "{", pack, pack * lanes
        self.valid = min(lanes, call.copies - self.first)  # lanes with a copy of their own
        self.copies = np.arange(self.first, self.first + lanes)
        self.copies[self.valid :] = 0

    def source(self, n: int, source: Source) -> str:
        """Return an argument that is read; numbers are first spread over the lanes, or gathered into them."""
        alone, tables = self.call.copies == 1, self.tables
        match source:
            case Own(start, size):
                return f"own + {start + self.pack * size}"
            case Constants(values) if not alone:
                return f"(const V *){tables.numbers(values[self.copies].T)}"
        index = source.at(self.call.copies)
        if isinstance(source, Constants):
            move, at = "set_lanes", tables.numbers(source.values)
        elif isinstance(source, Shared) or (alone and source.handed):
            move, at = "set_lanes", f"{source.memory} + {source.begin(1, tables)}"
        elif alone:
            move, at = "gather_all", f"{source.memory}, {tables.places(index)}"
        else:
            move, at = "gather_lanes", f"{source.memory}, {tables.places(index[self.copies].T)}"
        x = self.vector(f"x{n}", index.shape[1])
        self.before.append(f"{move}({x}, {at}, {index.shape[1]});")
        return x

    def target(self, n: int, target: Target, size: int, free: bool) -> str:
        """Return an argument that is written; all but the copies' own numbers are moved on afterwards."""
        y, valid = f"y{n}", self.valid
        rows = target.at(self.call.copies)[self.first : self.first + valid]
        match target:
            case Worst():
                self.after.append(f"*guard = worst_of_lanes(*guard, {y}[0], {valid});")
            case Own(start, _):
                place = f"own + {start + self.pack * size}"
                if free:
                    return place
                self.after.append(f"copy_lanes({place}, {y}, {size});")
            case Add(start, _):
                self.after.append(f"add_lanes(shared + {start}, {y}, {size}, {valid});")
            case Shared() | Each():
                self.after.append(f"spread_lanes(shared + {rows[0, 0]}, {y}, {size}, {valid});")
            case _:
                along = valid > 1 and (np.diff(rows, axis=0) == 1).all()
                move, at = ("store", rows[0]) if along else ("scatter", rows)
                self.after.append(f"{move}_lanes(result, {self.tables.places(at)}, {y}, {size}, {valid});")
        return self.vector(y, size)


def across_samples(
    program: Program, names: list[str], tables: Tables, head: str = HEAD, between: str = "",
    sums: Mapping[int, Collection[int]] = MappingProxyType({}),
) -> str:  # fmt: skip
    """Return the C function `<program>_samples`, or the one that `head` declares.

    Args:
        program: The program.
        names: C name of each kernel.
        tables: Collects the tables of the function.
        head: Its declaration.
        between: C statement before each kernel, in which {t} stands for the number of kernels before it.
        sums: Outputs that kernels add in place (`summed`), by kernel.
    """
    starts = iter(accumulate((step.copies for step in program.steps if isinstance(step, Call)), initial=0))

    def call(step: Call) -> list[str]:
        """Return the lines of a call."""
        t = f"{next(starts)}{' + i' if step.copies > 1 else ''}"
        return _CallBlock(step, tables, sums.get(step.kernel, ()), between.format(t=t)).lines(
            names[step.kernel]
        )

    return _driver(program, f"{head.format(name=program.name)} {{", tables, call, "set_all")


def across_copies(
    program: Program, names: list[str], lanes: int, tables: Tables, head: str, plain: Mapping[str, str]
) -> str:
    """Return the C function that `head` declares.

    Args:
        program: The program.
        names: C name of each kernel.
        lanes: Number of lanes.
        tables: Collects the tables of the function.
        head: Its declaration.
        plain: C names of kernels on plain numbers, for calls of one copy, by the names of the others.
    """

    def call(step: Call) -> list[str]:
        """Return the lines of C that call a kernel for all copies: on plain numbers, or in packs of lanes."""
        name = names[step.kernel]
        if step.copies == 1 and name in plain:
            return _Plain(step, tables).lines(plain[name])
        packs = range(-(-step.copies // lanes))
        return [line for pack in packs for line in _Pack(step, tables, pack, lanes).lines(name)]

    return _driver(program, head.format(name=program.name), tables, call, "copy_numbers")


def _driver(program: Program, head: str, tables: Tables, call: Callable[[Call], list[str]], move: str) -> str:
    """Return the C function that runs a program's steps in order; `move` sets shared numbers."""
    lines = [head, "    (void)given, (void)result, (void)shared, (void)own, (void)guard;"]
    for step in _joined(program):
        if isinstance(step, Call):
            lines += call(step)
        elif len(step.values):
            table = tables.numbers(step.values)
            lines.append(f"    {move}(shared + {step.start}, {table}, {len(step.values)});")
    return "\n".join([*lines, "}"])


def _joined(program: Program) -> list[Start | Call]:
    """Return the steps, with starts in a row that set numbers in a row as one: 8 % of the lx4's `ddm`."""
    steps: list[Start | Call] = []
    for step in program.steps:
        match (steps[-1:], step):
            case [Start(start, values)], Start(at, more) if at == start + len(values):
                steps[-1] = Start(start, np.concatenate([values, more]))
            case _:
                steps.append(step)
    return steps


def summed(program: Program) -> dict[int, set[int]]:
    """Return for kernels of legs, by index, the outputs that they should add to shared numbers in place.

    All calls of the kernel may add these, and they are `SUMMED` of its instructions or more.
    """
    sums: dict[int, set[int]] = {}
    for step in program.steps:
        if isinstance(step, Call):
            ends = enumerate(zip(step.targets, in_place(step), strict=True))
            added = {n for n, (end, free) in ends if end.adds and free and step.copies > 1}
            sums[step.kernel] = sums.get(step.kernel, added) & added
    functions = {k: program.kernels[k].function for k in sums}
    least = {k: max(1, SUMMED * f.n_instructions()) for k, f in functions.items()}
    return {k: x for k, x in sums.items() if sum(functions[k].nnz_out(n) for n in x) >= least[k]}


def in_place(call: Call) -> list[bool]:
    """Return for each target whether the kernel may write it directly.

    It may if no other argument shares its memory.
    """
    reads = [source.span(call.copies) for source in call.sources if source.handed]
    writes = [target.span(call.copies) for target in call.targets]
    return [
        not any(overlap(span, other) for other in [*reads, *writes[:n], *writes[n + 1 :]])
        for n, span in enumerate(writes)
    ]
