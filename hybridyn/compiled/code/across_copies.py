"""Generate the driver whose lanes hold copies: one sample, equal legs in parallel.

Numbers that the copies share are the same in all lanes. Lanes without a copy repeat the first copy. Sums add
the copies in their order, with the same additions as the other driver.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from ...spatial import Array, Index
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

HEAD = "static void {name}_copies(const S *given, S *result, V *shared, V *own, S *guard) {{"


def across_copies(program: Program, names: list[str], lanes: int, tables: Tables, head: str = HEAD) -> str:
    """Return the C function `<program>_copies`, or the one that `head` declares."""

    def call(step: Call, name: str) -> list[str]:
        """Return the lines of C that call a kernel for all copies: one by one, or in packs of lanes."""
        if step.copies == 1:
            return _alone(step, name, lanes, tables)
        packs = range(-(-step.copies // lanes))
        return [line for pack in packs for line in _Pack(step, pack, lanes, tables).text(name)]

    return driver(program, head.format(name=program.name), names, tables, call)


def _alone(call: Call, name: str, lanes: int, tables: Tables) -> list[str]:
    """Return the call of a kernel with one copy, the same in every lane."""
    block = Block.of(call, partial(_alone_source, tables, lanes), partial(_alone_target, tables))
    return block.lines(name)


def _turned(source: Turned, copies: Index, lanes: int) -> Index:
    """Return where own numbers that are read by columns are, in single numbers, shape (rows, copies)."""
    rows = np.arange(source.rows)
    first = source.start + (rows // lanes) * source.size + source.first
    at: Index = (first[:, None] + copies) * lanes + (rows % lanes)[:, None]
    return at


def _alone_source(tables: Tables, lanes: int, n: int, source: Source, block: Block) -> str:
    """Return an argument that is read; scalars are first spread over the lanes."""
    match source:
        case Shared(start, _) | Each(start, _):
            return f"shared + {start}"
        case Own(start, _):
            return f"own + {start}"
        case Turned(rows=rows):
            x = block.vector(f"x{n}", rows)
            at = tables.places(_turned(source, np.zeros(1, dtype=int), lanes))
            block.before.append(f"gather_all({x}, (const S *)own, {at}, {rows});")
            return x
        case Constants(values):
            x = block.vector(f"x{n}", values.size)
            block.before.append(f"set_all({x}, {tables.numbers(values)}, {values.size});")
            return x
        case Given(index) | Result(index):
            place = "given" if isinstance(source, Given) else "result"
            x = block.vector(f"x{n}", index.size)
            if steps_of_one(index):
                block.before.append(f"set_all({x}, {place} + {index[0, 0]}, {index.size});")
            else:
                block.before.append(f"gather_all({x}, {place}, {tables.places(index)}, {index.size});")
            return x


def _alone_target(tables: Tables, n: int, target: Target, free: bool, block: Block) -> str:
    """Return an argument that is written; results and the guard are taken from the first lane."""
    y = f"y{n}"
    match target:
        case Shared(_, 0) | Each(_, 0) | Own(_, 0) | Add(_, 0):
            size = 0
        case Shared(start, size) | Each(start, size) | Own(start, size):
            place = f"{'own' if isinstance(target, Own) else 'shared'} + {start}"
            if free:
                return place
            block.after.append(f"copy({place}, {y}, {size});")
        case Add(start, size):
            block.after.append(f"add(shared + {start}, {y}, {size});")
        case Result(index):
            size = index.size
            if size:
                block.after.append(f"scatter_first(result, {tables.places(index)}, {y}, {size});")
        case Worst():
            size = 1
            block.after.append(f"*guard = worst_of_lanes(*guard, {y}[0], 1);")
    return block.vector(y, size)


class _Pack:
    """Call of a kernel for one pack of copies, as many as there are lanes."""

    def __init__(self, call: Call, pack: int, lanes: int, tables: Tables) -> None:
        self.call, self.pack, self.lanes, self.tables = call, pack, lanes, tables
        self.first = pack * lanes
        self.valid = min(lanes, call.copies - self.first)  # lanes with a copy of their own
        self.copies = np.arange(self.first, self.first + lanes)
        self.copies[self.valid :] = 0

    def text(self, name: str) -> list[str]:
        """Return the lines of the call."""
        return Block.of(self.call, self._source, self._target).lines(name)

    def _lanes(self, values: Array | Index) -> Array | Index:
        """Return the copies' rows as columns, shape (entries, lanes)."""
        rows: Array | Index = values[self.copies].T
        return rows

    def _source(self, n: int, source: Source, block: Block) -> str:
        """Return an argument that is read; the copies' numbers are first gathered into their lanes."""
        match source:
            case Shared(start, _):
                return f"shared + {start}"
            case Own(start, size):
                return f"own + {start + self.pack * size}"
            case Constants(values):
                return f"(const V *){self.tables.numbers(np.asarray(self._lanes(values), dtype=float))}"
            case Given(index) | Result(index):
                place = "given" if isinstance(source, Given) else "result"
                size = index.shape[1]
                at = self._lanes(index)
            case Each(start, size):
                place = "(const S *)shared"
                at = (
                    start + size * self.copies + np.arange(size)[:, None]
                ) * self.lanes  # first lane of each
            case Turned(rows=size):
                place, at = "(const S *)own", _turned(source, self.copies, self.lanes)
        x = block.vector(f"x{n}", size)
        block.before.append(f"gather_lanes({x}, {place}, {self.tables.places(at.astype(int))}, {size});")
        return x

    def _target(self, n: int, target: Target, free: bool, block: Block) -> str:
        """Return an argument that is written; all but the copies' own numbers are moved on afterwards."""
        y, first, valid = f"y{n}", self.first, self.valid
        match target:
            case Own(_, 0) | Add(_, 0) | Each(_, 0):
                size = 0
            case Own(start, size):
                place = f"own + {start + self.pack * size}"
                if free:
                    return place
                block.after.append(f"copy({place}, {y}, {size});")
            case Add(start, size):
                block.after.append(f"add_lanes(shared + {start}, {y}, {size}, {valid});")
            case Each(start, size):
                block.after.append(f"spread_lanes(shared + {start + first * size}, {y}, {size}, {valid});")
            case Result(index):
                size, rows = index.shape[1], index[first : first + valid]
                if size and valid > 1 and (np.diff(rows, axis=0) == 1).all():
                    at = self.tables.places(rows[0])
                    block.after.append(f"store_lanes(result, {at}, {y}, {size}, {valid});")
                elif size:
                    at = self.tables.places(rows)
                    block.after.append(f"scatter_lanes(result, {at}, {y}, {size}, {valid});")
            case Worst():
                size = 1
                block.after.append(f"*guard = worst_of_lanes(*guard, {y}[0], {valid});")
            case Shared():
                raise ValueError("several copies write shared numbers")
        return block.vector(y, size)
