"""The driver whose lanes are samples: calls one after the other, copies one after the other.

With one lane it is the plain program of one sample.
"""

from __future__ import annotations

import numpy as np

from ..spatial import Index
from .checking import overlap, spans
from .program import (
    Add,
    Call,
    Constants,
    Each,
    Given,
    Own,
    Program,
    Result,
    Shared,
    Source,
    Start,
    Target,
    Worst,
)
from .tables import Tables, steps_of_one

HEAD = "static void {name}_samples(const V *given, V *result, V *shared, V *own, V *guard) {{"


def across_samples(program: Program, names: list[str], tables: Tables) -> str:
    """Give the function `<program>_samples` in C.

    Args:
        program: The program.
        names: Name in C of each kernel.
        tables: Where its tables go.
    """
    lines = [
        HEAD.format(name=program.name),
        "    (void)given, (void)result, (void)shared, (void)own, (void)guard;",
    ]
    for step in program.steps:
        if isinstance(step, Start):
            if len(step.values):
                table = tables.numbers(step.values)
                lines.append(f"    set_all(shared + {step.start}, {table}, {len(step.values)});")
        else:
            lines += _call(step, names[step.kernel], tables)
    return "\n".join([*lines, "}"])


def _call(call: Call, name: str, tables: Tables) -> list[str]:
    """Give a call of a kernel for each copy."""
    before: list[str] = []
    after: list[str] = []
    arguments: list[str] = []
    reads = [span for source, span in zip(call.sources, spans(call, 0), strict=True) if _direct(source)]
    for n, source in enumerate(call.sources):
        arguments.append(_source(call, n, source, tables, before))
    written = spans(call, 1)
    for n, target in enumerate(call.targets):
        free = not any(overlap(written[n], other) for other in [*reads, *written[:n], *written[n + 1 :]])
        arguments.append(_target(call, n, target, free, tables, before, after))
    body = [*before, f"{name}({', '.join(arguments)});", *after]
    head = "    {" if call.copies == 1 else f"    for (int i = 0; i < {call.copies}; i++) {{"
    return [head, *(f"        {line}" for line in body), "    }"]


def _direct(end: Source | Target) -> bool:
    """Say whether a kernel is handed the place itself and no copy of it."""
    match end:
        case Given(index) | Result(index):
            return steps_of_one(index)
        case Constants() | Worst() | Add():
            return False
    return True


def _row(call: Call, index: Index, tables: Tables) -> str:
    """Give where copy i begins, for places that count up by one."""
    first = index[:, 0] if index.shape[1] else np.zeros(len(index), dtype=int)
    return str(int(first[0])) if call.copies == 1 else f"{tables.places(first)}[i]"


def _at(call: Call, start: int, size: int) -> str:
    """Give where copy i begins, for places one behind the other."""
    return str(start) if call.copies == 1 else f"{start} + i * {size}"


def _source(call: Call, n: int, source: Source, tables: Tables, before: list[str]) -> str:
    """Give an argument that is read; what must be gathered first goes `before`."""
    match source:
        case Shared(_, 0) | Each(_, 0) | Own(_, 0):
            return "0"
        case Given(index) | Result(index):
            place = "given" if isinstance(source, Given) else "result"
            if steps_of_one(index):
                return f"{place} + {_row(call, index, tables)}"
            size = index.shape[1]
            before.append(f"V x{n}[{max(size, 1)}];")
            before.append(f"gather(x{n}, {place}, {tables.places(index)} + {_at(call, 0, size)}, {size});")
        case Constants(values):
            before.append(f"V x{n}[{max(values.shape[1], 1)}];")
            if values.size:
                at = f"{tables.numbers(values)} + {_at(call, 0, values.shape[1])}"
                before.append(f"set_all(x{n}, {at}, {values.shape[1]});")
        case Shared(start, _):
            return f"shared + {start}"
        case Each(start, size):
            return f"shared + {_at(call, start, size)}"
        case Own(start, size):
            return f"own + {_at(call, start, size)}"
    return f"x{n}"


def _target(
    call: Call, n: int, target: Target, free: bool, tables: Tables, before: list[str], after: list[str]
) -> str:
    """Give an argument that is written; what must be done with it afterwards goes `after`."""
    match target:
        case Shared(_, 0) | Each(_, 0) | Own(_, 0) | Add(_, 0):
            size = 0
        case Worst():
            before.append(f"V y{n}[1];")
            after.append(f"*guard = worst(*guard, y{n}[0]);")
            return f"y{n}"
        case Add(start, size):
            before.append(f"V y{n}[{max(size, 1)}];")
            after.append(f"add(shared + {start}, y{n}, {size});")
            return f"y{n}"
        case Result(index):
            if free and index.size and steps_of_one(index):
                return f"result + {_row(call, index, tables)}"
            size = index.shape[1]
            after.append(f"scatter(result, {tables.places(index)} + {_at(call, 0, size)}, y{n}, {size});")
        case Shared(start, size):
            if free:
                return f"shared + {start}"
            after.append(f"copy(shared + {start}, y{n}, {size});")
        case Each(start, size):
            if free:
                return f"shared + {_at(call, start, size)}"
            after.append(f"copy(shared + {_at(call, start, size)}, y{n}, {size});")
        case Own(start, size):
            if free:
                return f"own + {_at(call, start, size)}"
            after.append(f"copy(own + {_at(call, start, size)}, y{n}, {size});")
    before.append(f"V y{n}[{max(size, 1)}];")
    return f"y{n}"
