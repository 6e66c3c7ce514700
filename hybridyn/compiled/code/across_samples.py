"""Generate the driver whose lanes hold samples: calls and copies run one after the other.

With one lane it is the scalar program of one sample.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from functools import partial
from itertools import accumulate
from types import MappingProxyType

from ..program import Call, Constants, Program, Source, Target, Worst
from .drivers import Block, Tables, driver

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


def _source(call: Call, tables: Tables, n: int, source: Source, block: Block) -> str:
    """Return an argument that is read; entries that are not contiguous are gathered first."""
    copies, index = call.copies, source.at(call.copies)
    if source.handed:
        return f"{source.memory} + {source.begin(copies, tables)}"
    size = index.shape[1]
    x, at = block.vector(f"x{n}", size), _row(copies, size)
    match source:
        case Constants(values):
            block.before.append(f"set_all({x}, {tables.numbers(values)} + {at}, {size});")
        case _:
            block.before.append(f"gather({x}, {source.memory}, {tables.places(index)} + {at}, {size});")
    return x


def _row(copies: int, size: int) -> str:
    """Return the C expression of the start of row i of a table."""
    return "0" if copies == 1 else f"0 + i * {size}"


def _target(
    call: Call, tables: Tables, sums: Collection[int], n: int, target: Target, free: bool, block: Block
) -> str:
    """Return an argument that is written; what cannot be written in place is copied afterwards."""
    y, index = f"y{n}", target.at(call.copies)
    size = index.shape[1]
    if not size:
        return block.vector(y, 0)
    if isinstance(target, Worst):
        block.after.append(f"*guard = worst(*guard, {y}[0]);")
        return block.vector(y, 1)
    if target.memory == "result" and not (free and target.handed):
        at = f"{tables.places(index)} + {_row(call.copies, size)}"
        block.after.append(f"scatter(result, {at}, {y}, {size});")
        return block.vector(y, size)
    place = f"{target.memory} + {target.begin(call.copies, tables)}"
    if n in sums or (free and not target.adds):
        return place
    move = "add" if target.adds else "copy"
    block.after.append(f"{move}({place}, {y}, {size});")
    return block.vector(y, size)
