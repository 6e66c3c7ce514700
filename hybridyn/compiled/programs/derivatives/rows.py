"""Rows of the linear relations of one group (`relations`), one row in each lane."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np

from ...equations.expressions import Expression, dot, pack, symbols
from ...program import Shared, Source, Target
from ..writer import Writer
from .adjoints import PART, Adjoints, Parts, Pattern, Reading
from .columns import ONE, along_freedoms, pattern_of
from .dense import Block, matrix, new_block
from .groups import Group


class Rows:
    """Add the rows of a group's relations."""

    def __init__(self, writer: Writer, group: Group) -> None:
        self._w, self._group = writer, group

    def add(
        self,
        adjoints: Adjoints,
        read: dict[str, list[Parts]],
        carried: list[list[Shared]],
        sent: dict[str, Block],
    ) -> dict[str, Block]:
        """Add up adjoints, and add what changes of the group's outputs cause.

        Args:
            adjoints: The adjoints, one row for each result.
            read: Parts of the adjoints of the motions "u", the outputs' wrenches "W", the base's motion
                "moved", and the inputs.
            carried: For each output the wrenches over its motion, of all that it carries.
            sent: Rows of the outputs; without them, the rows are those of the outputs.

        Returns:
            Rows over the motions "u", over "unit" columns, and over the inputs.
        """
        w, at, whole = self._w, self._group.at, not carried and bool(self._group.children)
        reading = Reading.of([x for parts in read.values() for x in parts])
        kinds = at.kinds if any(kind not in ONE for kind in at.kinds) else ()
        widths = {name: len(parts) for name, parts in read.items()}
        names = ["u", "unit", *(name for name in read if name not in ("W", "moved", "u"))]
        given = [w.from_given("q", np.tile(at.q, (adjoints.rows, 1)))] if kinds else []

        def function() -> ca.Function:
            """Return one row over all inputs."""
            blocks, values = reading.symbols()
            row = dict(zip(widths, _split(values, list(widths.values())), strict=True))
            columns = list(blocks)
            if kinds:
                column, q = symbols("q", len(row["q"]))
                columns = [column, *columns]
                row["q"] = filled(along_freedoms(kinds, q, list(row["q"])))
            S = {}
            for name, block in sent.items():
                column, S[name] = _masked(name, block)
                columns.append(column)
            W: list[Expression] = []
            for o, wrenches in enumerate(carried):
                H: Any = 0.0
                for wrench in wrenches:
                    column, entries = matrix("H", wrench.size // 6, 6)
                    columns.append(column)
                    H = H + entries.T
                W.append(dot(row["W"][6 * o : 6 * o + 6], H))
            for name in sent:
                if name == "unit":
                    row["moved"] = row["moved"] + dot(np.concatenate(W), S["unit"][:, len(row["W"]) :])
                else:
                    row[name] = row[name] + dot(np.concatenate(W), S[name])
            row["unit"] = np.concatenate([row["W"], row["moved"]])
            stored = [row[name] for name in names for _ in range(2 if whole and name != "u" else 1)]
            return ca.Function("rows", columns, [pack(x) for x in stored])

        sizes = {"u": widths["u"], "unit": widths["W"] + widths["moved"]}
        sizes |= {name: len(at.v) if name == "q" else widths[name] for name in names[2:]}
        out = {name: new_block(w, adjoints.rows, sizes[name]) for name in names}
        targets: list[Target] = [out["u"].all]
        for name in names[1:]:
            targets += [out[name].rows, *([out[name].all] if whole else [])]
        shapes = tuple((name, block.rows.size, _pattern(block).tobytes()) for name, block in sent.items())
        wrenches = tuple(tuple(H.size for H in x) for x in carried)
        key = ("rows", reading.key, tuple(widths.items()), kinds, shapes, wrenches, whole)
        if adjoints.rows:
            sources: list[Source] = [*given, *reading.blocks]
            sources += [Shared(x.all.start, len(_pattern(x)) * x.all.size) for x in sent.values()]
            sources += [H for wrenches_of in carried for H in wrenches_of]
            w.call(w.kernel(key, function, PART), adjoints.rows, sources, targets)
        patterns = self._patterns(adjoints, read, kinds)
        return {name: replace(block, pattern=patterns.get(name)) for name, block in out.items()}

    def _patterns(
        self, adjoints: Adjoints, read: dict[str, list[Parts]], kinds: tuple[str, ...]
    ) -> dict[str, Pattern]:
        """Return which entries are not always zero, for rows of outputs."""
        of = {name: pattern_of(adjoints, parts, kinds if name == "q" else ()) for name, parts in read.items()}
        of["unit"] = np.concatenate([of["W"], of["moved"]], axis=1)
        return of


def _pattern(block: Block) -> Pattern:
    """Return a pattern that is known."""
    assert block.pattern is not None
    return block.pattern


def _split(values: list[Any], sizes: list[int]) -> list[Expression]:
    """Return parts of scalars as arrays of expressions."""
    ends = np.cumsum([0, *sizes]).tolist()
    return [filled(values[a:b]) for a, b in pairwise(ends)]


def _masked(name: str, block: Block) -> tuple[ca.SX, Expression]:
    """Return symbols of a matrix, and the matrix with its zeros."""
    column, entries = matrix(name, *_pattern(block).shape)
    return column, np.where(_pattern(block), entries, 0.0)


def filled(values: list[Any]) -> Expression:
    """Return scalars as an array of expressions."""
    out = np.empty(len(values), dtype=object)
    for i, value in enumerate(values):
        out[i] = value
    return out
