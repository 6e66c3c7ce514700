"""Parts shared by both drivers: tables, the sequence of steps, and a call with copies before and after it."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from ...spatial import Array, Index
from ..program import Call, Program, Source, Start, Target
from .kernels import literal
from .rules import overlap


def moves(kind: str) -> dict[str, str]:
    """Return the C functions that move numbers, by their names; `kind`: how C declares them."""
    return {
        name: f"{kind} void {name}({given}, int n) {{\n    int k;\n    for (k = 0; k < n; k++) {move};\n}}"
        for name, given, move in (
            ("set_all", "V *to, const S *from", "to[k] = C(from[k])"),
            ("copy", "V *to, const V *from", "to[k] = from[k]"),
            ("gather", "V *to, const V *from, const int *at", "to[k] = from[at[k]]"),
            ("scatter", "V *to, const int *at, const V *from", "to[at[k]] = from[k]"),
            ("add", "V *to, const V *from", "to[k] += from[k]"),
        )
    }


class Tables:
    """Collect tables; `text` declares them in C."""

    def __init__(self, dtype: str = "float64") -> None:
        """Start with no tables. `dtype`: type that numbers are rounded to before they are printed."""
        self._known: dict[str, str] = {}
        self._dtype = dtype

    @property
    def text(self) -> str:
        """The C declarations."""
        return "\n".join(f"static const {head.format(name)};" for head, name in self._known.items())

    def places(self, index: Index) -> str:
        """Return the name of a table of indices, of any shape."""
        return self._named(
            "int {}" + _shape(index) + " = {{" + ", ".join(map(str, index.ravel().tolist())) + "}}"
        )

    def numbers(self, values: Array) -> str:
        """Return the name of a table of numbers, of any shape."""
        body = ", ".join(map(literal, values.astype(self._dtype).ravel().tolist()))
        return self._named("S {} " + _shape(values) + " ALIGNED = {{" + body + "}}")

    def _named(self, head: str) -> str:
        if head not in self._known:
            self._known[head] = f"d{hashlib.sha256(head.encode()).hexdigest()[:12]}"
        return self._known[head]


def _shape(array: Array | Index) -> str:
    """Return the C dimension of a flattened table."""
    return f"[{max(array.size, 1)}]"


#: Least share of sums in the instructions of legs whose kernels are compiled a second time to add them in
#: place: 7 % in direct models, whose batches then take a tenth less; 2 % in inverse models.
SUMMED = 0.05


@dataclass
class Block:
    """C block of one call of a kernel.

    Attributes:
        before: Lines before the call: local vectors, and gathering into them.
        arguments: Arguments of the call.
        after: Lines after the call: copying from local vectors to their targets.
        type: C type of the entries of local vectors.
    """

    type: str = "V"
    before: list[str] = field(default_factory=list)
    arguments: list[str] = field(default_factory=list)
    after: list[str] = field(default_factory=list)

    @classmethod
    def of(
        cls,
        call: Call,
        source: Callable[[int, Source, Block], str],
        target: Callable[[int, Target, bool, Block], str],
        type: str = "V",
    ) -> Block:
        """Build the block of a call from functions that return an argument that is read, or written.

        They take its number, the source, or the target and whether it may be written in place, and the block.
        An argument without numbers is the null pointer: a local vector would never be set, which compilers
        warn of.
        """
        block = cls(type)
        for n, read in enumerate(call.sources):
            block.arguments.append(source(n, read, block) if read.at(call.copies).size else "0")
        for n, (written, free) in enumerate(zip(call.targets, in_place(call), strict=True)):
            block.arguments.append(target(n, written, free, block))
        return block

    def vector(self, name: str, size: int) -> str:
        """Declare a local vector and return its name."""
        self.before.append(f"{self.type} {name}[{max(size, 1)}];")
        return name

    def lines(self, kernel: str, head: str = "{") -> list[str]:
        """Return the lines of the block."""
        body = [*self.before, f"{kernel}({', '.join(self.arguments)});", *self.after]
        return [f"    {head}", *(f"        {line}" for line in body), "    }"]


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


def driver(
    program: Program, head: str, names: list[str], tables: Tables, call: Callable[[Call, str], list[str]],
    move: str = "set_all",
) -> str:  # fmt: skip
    """Return the C function that runs a program's steps in order.

    Args:
        head: First line of the function.
        names: C name of each kernel.
        tables: Collects its tables.
        call: Returns the lines of a call from the call and its kernel's name.
        move: C function that sets shared numbers.
    """
    lines = [head, "    (void)given, (void)result, (void)shared, (void)own, (void)guard;"]
    for step in _joined(program):
        if isinstance(step, Call):
            lines += call(step, names[step.kernel])
        elif len(step.values):
            table = tables.numbers(step.values)
            lines.append(f"    {move}(shared + {step.start}, {table}, {len(step.values)});")
    return "\n".join([*lines, "}"])


def _joined(program: Program) -> list[Start | Call]:
    """Return the steps, with starts in a row that set numbers in a row as one."""
    steps: list[Start | Call] = []
    for step in program.steps:
        last = steps[-1] if steps else None
        if (
            isinstance(step, Start)
            and isinstance(last, Start)
            and step.start == last.start + len(last.values)
        ):
            steps[-1] = Start(last.start, np.concatenate([last.values, step.values]))
        else:
            steps.append(step)
    return steps


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
