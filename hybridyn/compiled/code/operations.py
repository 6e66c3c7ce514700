"""Count the operations of a program for one sample, by part."""

from __future__ import annotations

from collections import Counter

from ..program import Add, Call, Kernel, Program
from .quotients import costing, operations_of

#: Kinds of operations: sums and differences; products; quotients; square roots; sines and cosines; others.
KINDS = ("add", "mul", "div", "sqrt", "trig", "other")

_KIND = {"add": "add", "sub": "add", "mul": "mul", "div": "div", "sqrt": "sqrt", "sin": "trig", "cos": "trig"}

Counts = dict[str, dict[str, int]]


def operations(program: Program) -> Counts:
    """Count operations by part (`Kernel.part`) and kind, over all calls and copies.

    Returns:
        For each part, in the order of the calls, the number of operations of each kind.
    """
    each = [_by_part(kernel) for kernel in program.kernels]
    out: dict[str, Counter[str]] = {}
    for step in program.steps:
        if isinstance(step, Call):
            for part, numbers in each[step.kernel].items():
                total = out.setdefault(part, Counter())
                for kind, number in numbers.items():
                    total[kind] += number * step.copies
            total["add"] += step.copies * sum(t.size for t in step.targets if isinstance(t, Add))
    return {part: {kind: total[kind] for kind in KINDS} for part, total in out.items()}


def _by_part(kernel: Kernel) -> dict[str, Counter[str]]:
    """Return the operations of a kernel by part and kind, its own part last."""
    out: dict[str, Counter[str]] = {}
    before: Counter[str] = Counter()
    for part, function in (*kernel.shares, (kernel.part, kernel.function)):
        nodes = costing(operations_of(function))
        count = Counter(_KIND.get(node.name, "other") for node in nodes)
        out[part] = Counter(count)
        out[part].subtract(before)
        before = count
    return out


def operations_table(variants: dict[str, Program]) -> str:
    """Return a printable table of the operations of variants of one model."""
    counts = {name: operations(program) for name, program in variants.items()}
    parts = list(dict.fromkeys(part for table in counts.values() for part in table))
    width = max(len(x) for x in [*parts, *variants, "total"]) + 2
    lines = ["".ljust(width) + "".join(kind.rjust(8) for kind in (*KINDS, "sum"))]
    for name, table in counts.items():
        lines.append(name)
        total = {kind: sum(part[kind] for part in table.values()) for kind in KINDS}
        for part, numbers in [*((part, table[part]) for part in parts if part in table), ("total", total)]:
            cells = [numbers[kind] for kind in KINDS]
            lines.append(f"  {part}".ljust(width) + "".join(str(x).rjust(8) for x in (*cells, sum(cells))))
    return "\n".join(lines)
