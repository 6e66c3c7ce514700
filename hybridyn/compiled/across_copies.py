"""The driver whose lanes are copies: one sample, equal legs side by side.

What is not a copy's own is the same in all lanes; lanes without a copy repeat the first one. Sums take the
copies in their order, from the lanes: the very additions of the other driver.
"""

from __future__ import annotations

import numpy as np

from ..spatial import Array, Index
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

HEAD = "static void {name}_copies(const S *given, S *result, V *shared, V *own, S *guard) {{"


def across_copies(program: Program, names: list[str], lanes: int, tables: Tables) -> str:
    """Give the function `<program>_copies` in C.

    Args:
        program: The program.
        names: Name in C of each kernel.
        lanes: Number of lanes.
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
        elif step.copies == 1:
            lines += _Alone(step, tables).text(names[step.kernel])
        else:
            lines += _Together(step, lanes, tables).text(names[step.kernel])
    return "\n".join([*lines, "}"])


class _Alone:
    """A call of one copy: every lane the same."""

    def __init__(self, call: Call, tables: Tables) -> None:
        self.call, self.tables = call, tables
        self.before: list[str] = []
        self.after: list[str] = []
        self.reads, self.writes = spans(call, 0), spans(call, 1)

    def text(self, name: str) -> list[str]:
        """Give the call."""
        arguments = [self._source(n, source) for n, source in enumerate(self.call.sources)]
        arguments += [self._target(n, target) for n, target in enumerate(self.call.targets)]
        body = [*self.before, f"{name}({', '.join(arguments)});", *self.after]
        return ["    {", *(f"        {line}" for line in body), "    }"]

    def _source(self, n: int, source: Source) -> str:
        match source:
            case Shared(start, _) | Each(start, _):
                return f"shared + {start}"
            case Own(start, _):
                return f"own + {start}"
            case Constants(values):
                self.before.append(f"V x{n}[{max(values.size, 1)}];")
                if values.size:
                    self.before.append(f"set_all(x{n}, {self.tables.numbers(values)}, {values.size});")
            case Given(index) | Result(index):
                place = "given" if isinstance(source, Given) else "result"
                self.before.append(f"V x{n}[{max(index.size, 1)}];")
                if index.size and steps_of_one(index):
                    self.before.append(f"set_all(x{n}, {place} + {index[0, 0]}, {index.size});")
                elif index.size:
                    self.before.append(
                        f"gather_all(x{n}, {place}, {self.tables.places(index)}, {index.size});"
                    )
        return f"x{n}"

    def _target(self, n: int, target: Target) -> str:
        others = [*self.reads, *self.writes[:n], *self.writes[n + 1 :]]
        free = not any(overlap(self.writes[n], other) for other in others)
        match target:
            case Shared(start, size) | Each(start, size):
                if free:
                    return f"shared + {start}"
                self.after.append(f"copy(shared + {start}, y{n}, {size});")
            case Own(start, size):
                if free:
                    return f"own + {start}"
                self.after.append(f"copy(own + {start}, y{n}, {size});")
            case Add(start, size):
                self.after.append(f"add(shared + {start}, y{n}, {size});")
            case Result(index):
                size = index.size
                if size:
                    self.after.append(f"scatter_first(result, {self.tables.places(index)}, y{n}, {size});")
            case Worst():
                size = 1
                self.after.append(f"*guard = worst_of_lanes(*guard, y{n}[0], 1);")
        self.before.append(f"V y{n}[{max(size, 1)}];")
        return f"y{n}"


class _Together:
    """A call of several copies: packs of as many as there are lanes."""

    def __init__(self, call: Call, lanes: int, tables: Tables) -> None:
        self.call, self.lanes, self.tables = call, lanes, tables
        self.packs = -(-call.copies // lanes)
        self.copy = np.arange(self.packs * lanes)
        self.copy[call.copies :] = 0
        self.reads, self.writes = spans(call, 0), spans(call, 1)

    def text(self, name: str) -> list[str]:
        """Give the calls, pack after pack."""
        lines: list[str] = []
        for pack in range(self.packs):
            before: list[str] = []
            after: list[str] = []
            arguments = [self._source(n, source, pack, before) for n, source in enumerate(self.call.sources)]
            arguments += [
                self._target(n, target, pack, before, after) for n, target in enumerate(self.call.targets)
            ]
            body = [*before, f"{name}({', '.join(arguments)});", *after]
            lines += ["    {", *(f"        {line}" for line in body), "    }"]
        return lines

    def _lanes(self, values: Array | Index, pack: int) -> Array | Index:
        """Give rows of the copies of a pack, side by side: (entries, lanes)."""
        rows: Array | Index = values[self.copy[pack * self.lanes : (pack + 1) * self.lanes]].T
        return rows

    def _valid(self, pack: int) -> int:
        """Give the number of lanes with a copy of their own."""
        return min(self.lanes, self.call.copies - pack * self.lanes)

    def _source(self, n: int, source: Source, pack: int, before: list[str]) -> str:
        match source:
            case Shared(start, _):
                return f"shared + {start}"
            case Own(start, size):
                return f"own + {start + pack * size}"
            case Constants(values):
                return f"(const V *){self.tables.numbers(np.asarray(self._lanes(values, pack), dtype=float))}"
            case Given(index) | Result(index):
                place = "given" if isinstance(source, Given) else "result"
                size = index.shape[1]
                at = self._lanes(index, pack)
            case Each(start, size):
                place = "(const S *)shared"
                at = (start + size * self._lanes(np.arange(self.call.copies)[:, None], pack)) + np.arange(
                    size
                )[:, None]
                at = at * self.lanes  # the first lane of each
        before.append(f"V x{n}[{max(size, 1)}];")
        if size:
            before.append(f"gather_lanes(x{n}, {place}, {self.tables.places(at.astype(int))}, {size});")
        return f"x{n}"

    def _target(self, n: int, target: Target, pack: int, before: list[str], after: list[str]) -> str:
        valid, first = self._valid(pack), pack * self.lanes
        match target:
            case Own(start, size):
                others = [*self.reads, *self.writes[:n], *self.writes[n + 1 :]]
                if not any(overlap(self.writes[n], other) for other in others):
                    return f"own + {start + pack * size}"
                after.append(f"copy(own + {start + pack * size}, y{n}, {size});")
            case Add(start, size):
                after.append(f"add_lanes(shared + {start}, y{n}, {size}, {valid});")
            case Each(start, size):
                after.append(f"spread_lanes(shared + {start + first * size}, y{n}, {size}, {valid});")
            case Result(index):
                size = index.shape[1]
                if size:
                    at = self.tables.places(index[first : first + valid])
                    after.append(f"scatter_lanes(result, {at}, y{n}, {size}, {valid});")
            case Worst():
                size = 1
                after.append(f"*guard = worst_of_lanes(*guard, y{n}[0], {valid});")
            case Shared():
                raise ValueError("several copies write shared numbers")
        before.append(f"V y{n}[{max(size, 1)}];")
        return f"y{n}"
