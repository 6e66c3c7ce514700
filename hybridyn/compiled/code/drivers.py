"""What both drivers share: steps in their order, a call with what is copied before and after it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from ..program import Call, Constants, Given, Program, Result, Source
from .rules import overlap, spans
from .tables import Tables, steps_of_one


@dataclass
class Block:
    """One call of a kernel in C.

    Attributes:
        before: Lines before it: vectors of its own, and what is gathered into them.
        arguments: Its arguments.
        after: Lines after it: where what it wrote to vectors of its own goes.
    """

    before: list[str] = field(default_factory=list)
    arguments: list[str] = field(default_factory=list)
    after: list[str] = field(default_factory=list)

    def vector(self, name: str, size: int) -> str:
        """Declare a vector of its own, and give its name."""
        self.before.append(f"V {name}[{max(size, 1)}];")
        return name

    def lines(self, kernel: str, head: str = "{") -> list[str]:
        """Return the block."""
        body = [*self.before, f"{kernel}({', '.join(self.arguments)});", *self.after]
        return [f"    {head}", *(f"        {line}" for line in body), "    }"]


def driver(
    program: Program, head: str, names: list[str], tables: Tables, call: Callable[[Call, str], list[str]]
) -> str:
    """Return a function that takes a program's steps.

    Args:
        program: The program.
        head: The line that opens it.
        names: Name in C of each kernel.
        tables: Where its tables go.
        call: Gives the lines of a call, from the call and its kernel's name.
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
    """Say for each target whether a kernel may write it itself: no other argument shares its memory."""
    reads = [span for source, span in zip(call.sources, spans(call, 0), strict=True) if _handed(source)]
    writes = spans(call, 1)
    return [
        not any(overlap(span, other) for other in [*reads, *writes[:n], *writes[n + 1 :]])
        for n, span in enumerate(writes)
    ]


def _handed(source: Source) -> bool:
    """Say whether a kernel may be handed the place itself and no copy of it."""
    match source:
        case Given(index) | Result(index):
            return steps_of_one(index)
        case Constants():
            return False
    return True
