"""Parts shared by both drivers: the sequence of steps, and a call with the copies before and after it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from ..program import Call, Constants, Each, Given, Own, Program, Result, Shared, Source, Target, Turned
from .rules import overlap, spans
from .tables import Tables, steps_of_one


@dataclass
class Block:
    """C block of one call of a kernel.

    Attributes:
        before: Lines before the call: local vectors, and gathering into them.
        arguments: Arguments of the call.
        after: Lines after the call: copying from local vectors to their targets.
    """

    before: list[str] = field(default_factory=list)
    arguments: list[str] = field(default_factory=list)
    after: list[str] = field(default_factory=list)

    @classmethod
    def of(
        cls,
        call: Call,
        source: Callable[[int, Source, Block], str],
        target: Callable[[int, Target, bool, Block], str],
    ) -> Block:
        """Build the block of a call from functions that return an argument that is read, or written.

        They take its number, the source, or the target and whether it may be written in place, and the block.
        An argument without numbers is the null pointer: a local vector would never be set, which compilers
        warn of.
        """
        block = cls()
        for n, read in enumerate(call.sources):
            block.arguments.append("0" if _is_empty(read) else source(n, read, block))
        for n, (written, free) in enumerate(zip(call.targets, in_place(call), strict=True)):
            block.arguments.append(target(n, written, free, block))
        return block

    def vector(self, name: str, size: int) -> str:
        """Declare a local vector and return its name."""
        self.before.append(f"V {name}[{max(size, 1)}];")
        return name

    def lines(self, kernel: str, head: str = "{") -> list[str]:
        """Return the lines of the block."""
        body = [*self.before, f"{kernel}({', '.join(self.arguments)});", *self.after]
        return [f"    {head}", *(f"        {line}" for line in body), "    }"]


def driver(
    program: Program, head: str, names: list[str], tables: Tables, call: Callable[[Call, str], list[str]]
) -> str:
    """Return the C function that runs a program's steps in order.

    Args:
        head: First line of the function.
        names: C name of each kernel.
        tables: Collects its tables.
        call: Returns the lines of a call from the call and its kernel's name.
    """
    lines = [head, "    (void)given, (void)result, (void)shared, (void)own, (void)guard;"]
    for step in program.steps:
        if isinstance(step, Call):
            lines += call(step, names[step.kernel])
        elif len(step.values):
            table = tables.numbers(step.values)
            lines.append(f"    set_all(shared + {step.start}, {table}, {len(step.values)});")
    return "\n".join([*lines, "}"])


def in_place(call: Call) -> list[bool]:
    """Return for each target whether the kernel may write it directly.

    It may if no other argument shares its memory.
    """
    reads = [span for source, span in zip(call.sources, spans(call, 0), strict=True) if _handed(source)]
    writes = spans(call, 1)
    return [
        not any(overlap(span, other) for other in [*reads, *writes[:n], *writes[n + 1 :]])
        for n, span in enumerate(writes)
    ]


def _is_empty(source: Source) -> bool:
    """Return whether a source has no numbers."""
    match source:
        case Given(entries) | Result(entries) | Constants(entries):
            return entries.size == 0
        case Turned(rows=size) | Shared(_, size) | Each(_, size) | Own(_, size):
            return size == 0


def _handed(source: Source) -> bool:
    """Return whether a kernel may read a source directly, without a copy."""
    match source:
        case Given(index) | Result(index):
            return steps_of_one(index)
        case Constants() | Turned():
            return False
    return True
