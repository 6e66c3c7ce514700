"""Generate the drivers of a program: one whose lanes hold samples, and one whose lanes hold copies.

With samples in the lanes, calls and copies run one after the other; with one lane it is the scalar program
of one sample. With copies in the lanes, one sample computes equal legs in parallel. Numbers that the copies
share are plain numbers. Lanes without a copy repeat the first copy. Sums add the copies in their order, with
the same additions as the other driver. What has one copy runs on plain numbers where there is code for it.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from functools import partial
from itertools import accumulate
from types import MappingProxyType

import numpy as np

from ..program import Add, Call, Constants, Each, Own, Program, Shared, Source, Target, Worst
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


COPIES_HEAD = "static void {name}_copies(const S *given, S *result, S *shared, V *own, S *guard) {{"


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

    def call(step: Call, name: str) -> list[str]:
        """Return the lines of C that call a kernel for all copies: on plain numbers, or in packs of lanes."""
        if step.copies == 1 and name in plain:
            block = Block.of(step, partial(_plain_source, tables), partial(_plain_target, tables), "S")
            return block.lines(plain[name])
        packs = range(-(-step.copies // lanes))
        return [line for pack in packs for line in _Pack(step, pack, lanes, tables).text(name)]

    return driver(program, head.format(name=program.name), names, tables, call, "copy_numbers")


def _plain_source(tables: Tables, n: int, source: Source, block: Block) -> str:
    """Return an argument of plain numbers that is read; entries that are not contiguous are gathered."""
    if isinstance(source, Constants):
        return tables.numbers(source.values)
    if source.handed:
        return _plain_place(tables, source)
    index = source.at(1)
    x = block.vector(f"x{n}", index.size)
    block.before.append(f"gather_numbers({x}, {source.memory}, {tables.places(index)}, {index.size});")
    return x


def _plain_place(tables: Tables, end: Source | Target) -> str:
    """Return the place of the first of some plain numbers; those of `own` begin where its vector does."""
    place = f"{end.memory} + {end.begin(1, tables)}"
    return f"(S *)({place})" if end.memory == "own" else place


def _plain_target(tables: Tables, n: int, target: Target, free: bool, block: Block) -> str:
    """Return an argument that is written; what cannot be written in place is copied afterwards."""
    y, index = f"y{n}", target.at(1)
    size = index.size
    if isinstance(target, Worst):
        block.after.append(f"*guard = worst_number(*guard, {y}[0]);")
    elif size and not target.handed:
        block.after.append(f"scatter_numbers(result, {tables.places(index)}, {y}, {size});")
    elif size:
        place = _plain_place(tables, target)
        if free and not target.adds:
            return place
        block.after.append(f"{'add' if target.adds else 'copy'}_numbers({place}, {y}, {size});")
    return block.vector(y, size)


class _Pack:
    """Call of a kernel for one pack of copies, as many as there are lanes."""

    def __init__(self, call: Call, pack: int, lanes: int, tables: Tables) -> None:
        self.call, self.pack, self.tables = call, pack, tables
        self.first = pack * lanes
        self.valid = min(lanes, call.copies - self.first)  # lanes with a copy of their own
        self.copies = np.arange(self.first, self.first + lanes)
        self.copies[self.valid :] = 0

    def text(self, name: str) -> list[str]:
        """Return the lines of the call."""
        return Block.of(self.call, self._source, self._target).lines(name)

    def _source(self, n: int, source: Source, block: Block) -> str:
        """Return an argument that is read; numbers are first spread over the lanes, or gathered into them."""
        alone = self.call.copies == 1
        match source:
            case Own(start, size):
                return f"own + {start + self.pack * size}"
            case Constants(values) if not alone:
                return f"(const V *){self.tables.numbers(values[self.copies].T)}"
        index = source.at(self.call.copies)
        size = index.shape[1]
        x = block.vector(f"x{n}", size)
        if isinstance(source, Constants):
            move = f"set_lanes({x}, {self.tables.numbers(source.values)}, {size});"
        elif isinstance(source, Shared) or (alone and source.handed):
            move = f"set_lanes({x}, {source.memory} + {source.begin(1, self.tables)}, {size});"
        elif alone:
            move = f"gather_all({x}, {source.memory}, {self.tables.places(index)}, {size});"
        else:
            at = self.tables.places(index[self.copies].T)
            move = f"gather_lanes({x}, {source.memory}, {at}, {size});"
        block.before.append(move)
        return x

    def _target(self, n: int, target: Target, free: bool, block: Block) -> str:
        """Return an argument that is written; all but the copies' own numbers are moved on afterwards."""
        y, valid = f"y{n}", self.valid
        rows = target.at(self.call.copies)[self.first : self.first + valid]
        size = rows.shape[1]
        match target:
            case Worst():
                block.after.append(f"*guard = worst_of_lanes(*guard, {y}[0], {valid});")
            case _ if not size:
                pass
            case Own(start, _):
                place = f"own + {start + self.pack * size}"
                if free:
                    return place
                block.after.append(f"copy_lanes({place}, {y}, {size});")
            case Add(start, _):
                block.after.append(f"add_lanes(shared + {start}, {y}, {size}, {valid});")
            case Shared() | Each():
                block.after.append(f"spread_lanes(shared + {rows[0, 0]}, {y}, {size}, {valid});")
            case _:
                along = valid > 1 and (np.diff(rows, axis=0) == 1).all()
                move, at = ("store", rows[0]) if along else ("scatter", rows)
                places = self.tables.places(at)
                block.after.append(f"{move}_lanes(result, {places}, {y}, {size}, {valid});")
        return block.vector(y, size)
