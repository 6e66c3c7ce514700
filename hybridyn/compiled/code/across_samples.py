"""Generate the driver whose lanes hold samples: calls and copies run one after the other.

With one lane it is the scalar program of one sample.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from functools import partial
from itertools import accumulate
from types import MappingProxyType

import numpy as np

from ...spatial import Index
from ..program import (
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
    Target,
    Turned,
    Worst,
)
from .drivers import Block, driver
from .tables import Tables, steps_of_one

HEAD = "static void {name}_samples(const V *given, V *result, V *shared, V *own, V *guard)"


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
        sums: Outputs that kernels add in place (`drivers.summed`), by kernel.
    """
    starts = iter(accumulate((step.copies for step in program.steps if isinstance(step, Call)), initial=0))

    def call(step: Call, name: str) -> list[str]:
        """Return the lines of a call."""
        t = f"{next(starts)}{' + i' if step.copies > 1 else ''}"
        return _call(step, name, tables, between.format(t=t), sums.get(step.kernel, ()))

    return driver(program, f"{head.format(name=program.name)} {{", names, tables, call)


def _call(call: Call, name: str, tables: Tables, between: str, sums: Collection[int]) -> list[str]:
    """Return the calls of a kernel for all copies, with a statement before each."""
    block = Block.of(call, partial(_source, call, tables), partial(_target, call, tables, sums))
    if between:
        block.before.insert(0, between)
    head = "{" if call.copies == 1 else f"for (int i = 0; i < {call.copies}; i++) {{"
    return block.lines(name, head)


def _row(call: Call, index: Index, tables: Tables) -> str:
    """Return the C expression of the start of copy i, for indices that increase by one in each row."""
    first = index[:, 0] if index.shape[1] else np.zeros(len(index), dtype=int)
    return str(int(first[0])) if call.copies == 1 else f"{tables.places(first)}[i]"


def _at(call: Call, start: int, size: int) -> str:
    """Return the C expression of the start of copy i, for copies stored one after the other."""
    return str(start) if call.copies == 1 else f"{start} + i * {size}"


def _source(call: Call, tables: Tables, n: int, source: Source, block: Block) -> str:
    """Return an argument that is read; entries that are not contiguous are gathered first."""
    match source:
        case Given(index) | Result(index):
            place = "given" if isinstance(source, Given) else "result"
            if steps_of_one(index):
                return f"{place} + {_row(call, index, tables)}"
            size = index.shape[1]
            x = block.vector(f"x{n}", size)
            block.before.append(
                f"gather({x}, {place}, {tables.places(index)} + {_at(call, 0, size)}, {size});"
            )
            return x
        case Constants(values):
            size = values.shape[1]
            x = block.vector(f"x{n}", size)
            at = f"{tables.numbers(values)} + {_at(call, 0, size)}"
            block.before.append(f"set_all({x}, {at}, {size});")
            return x
        case Shared(start, _):
            return f"shared + {start}"
        case Each(start, size):
            return f"shared + {_at(call, start, size)}"
        case Own(start, size):
            return f"own + {_at(call, start, size)}"
        case Turned(rows=rows):
            x = block.vector(f"x{n}", rows)
            at = tables.places(np.asarray(source.index(0)))
            block.before.append(f"gather({x}, own + {_at(call, 0, 1)}, {at}, {rows});")
            return x


def _target(
    call: Call, tables: Tables, sums: Collection[int], n: int, target: Target, free: bool, block: Block
) -> str:
    """Return an argument that is written; what cannot be written in place is copied afterwards."""
    y = f"y{n}"
    match target:
        case Shared(_, 0) | Each(_, 0) | Own(_, 0) | Add(_, 0):
            return block.vector(y, 0)
        case Worst():
            block.after.append(f"*guard = worst(*guard, {y}[0]);")
            return block.vector(y, 1)
        case Add(start, _) if n in sums:
            return f"shared + {start}"
        case Add(start, size):
            block.after.append(f"add(shared + {start}, {y}, {size});")
            return block.vector(y, size)
        case Result(index):
            size = index.shape[1]
            if free and index.size and steps_of_one(index):
                return f"result + {_row(call, index, tables)}"
            at = f"{tables.places(index)} + {_at(call, 0, size)}"
            block.after.append(f"scatter(result, {at}, {y}, {size});")
            return block.vector(y, size)
        case Shared(start, size):
            place = f"shared + {start}"
        case Each(start, size):
            place = f"shared + {_at(call, start, size)}"
        case Own(start, size):
            place = f"own + {_at(call, start, size)}"
    if free:
        return place
    block.after.append(f"copy({place}, {y}, {size});")
    return block.vector(y, size)
