"""Cut one graph of expressions into stages that run at different times, and write the symbols of modules.

A model is written as one graph, but some of its inputs are known only at a later stage. Each stage passes
the intermediate results to later stages that need them, so that nothing is computed twice.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from ...spatial import Index
from ...symbols import Expression
from .core import Core, write_core
from .expressions import pack, plain, symbols, zeros
from .factors import Handed
from .module_plan import ModulePlan
from .options import Options


@dataclass(frozen=True)
class Stage:
    """One stage of a cut graph.

    Attributes:
        inputs: Names of its inputs in order; ("from", s) holds the intermediate results of stage s.
        outputs: Names of its outputs in order; ("to", t) holds the intermediate results for stage t.
        function: The CasADi function.
    """

    inputs: tuple[Any, ...]
    outputs: tuple[Any, ...]
    function: ca.Function


class GivenColumns(dict[str, ca.SX]):
    """Columns of symbols that are first known at a stage, by name."""

    def take(self, name: str, n: int) -> Expression:
        """Add n symbols, or nothing if n is zero, and return them as an array."""
        column, entries = symbols(name, n)
        self |= {name: column} if n else {}
        return entries

    def scattered(self, name: str, index: Index | list[int], width: int) -> Expression:
        """Add symbols for some entries of a vector, and return the vector with zeros in its other entries."""
        out = zeros(width)
        out[index] = self.take(name, len(index))
        return out

    def base_twist(self, options: Options) -> Expression:
        """Add the twist of a module's base, and return it in its own frame, shape (6,).

        Every module is written relative to an observer who moves with its base's origin. So only the base's
        angular velocity matters, and no digits are lost to a common velocity. Without velocity terms the
        model is not the same for all observers, and the whole twist is used.
        """
        width = twist_width(options.velocity) if options.base is None else 0
        return np.concatenate([zeros(6 - width), self.take("V_base", width)])

    def base_acceleration(self, options: Options) -> Expression:
        """Add the acceleration (less gravity) of a module's base, and return it in its own frame."""
        return self.take("A_base", 6) if options.base is None else plain(options.base)


@dataclass(eq=False)
class Draft:
    """What a stage is to be: a graph is written in what drafts give, and asks them for what they compute.

    Attributes:
        given: Columns of symbols that are first known at it, by name.
        wanted: Columns that it must compute, by name.
    """

    given: GivenColumns = field(default_factory=GivenColumns)
    wanted: dict[str, ca.SX] = field(default_factory=dict)


def cut(drafts: Sequence[Draft]) -> list[Stage]:
    """Cut a graph into stages.

    A stage computes whatever its inputs suffice for, also what only a later stage asks for.

    Returns:
        The stages. The inputs of a stage are those it uses, also those of earlier stages.
    """
    inputs, outputs = ([getattr(draft, name) for draft in drafts] for name in ("given", "wanted"))
    whole = iter(ca.cse([ca.densify(column) for columns in outputs for column in columns.values()]))
    wanted = [{name: next(whole) for name in columns} for columns in outputs]
    known: list[ca.SX] = []
    handed: list[list[_Passed]] = []  # by stage: the numbers that it passes on, as symbols
    for s, columns in enumerate(inputs):
        known += columns.values()
        later = [column for stage in wanted[s + 1 :] for column in stage.values()]
        later, own, values = ca.extract_parametric(later, known, {}) if later else ([], [], [])
        known += own
        handed.append([_Passed(x, value, x.element_hash()) for x, value in zip(own, values, strict=True)])
        left = iter(later)
        wanted[s + 1 :] = [{name: next(left) for name in stage} for stage in wanted[s + 1 :]]
    used = [
        _symbols(*columns.values(), *(one.value for one in passed))
        for columns, passed in zip(wanted, handed, strict=True)
    ]
    given = [
        [(name, x, {symbol.element_hash() for symbol in x.nonzeros()}) for name, x in stage.items()]
        for stage in inputs
    ]
    return [_stage(s, given, columns, handed, used) for s, columns in enumerate(wanted)]


class _Passed(NamedTuple):
    """A number that a stage passes on: its symbol and value, and what identifies the symbol."""

    symbol: ca.SX
    value: ca.SX
    known_as: int


def _stage(
    s: int, inputs: Sequence[list[tuple[str, ca.SX, set[int]]]], wanted: dict[str, ca.SX],
    handed: list[list[_Passed]], used: list[set[int]],
) -> Stage:  # fmt: skip
    """Return stage s.

    Args:
        inputs: For each stage the columns of symbols that are first known at it: names, columns, and what
            identifies their symbols.
        wanted: The columns that it must compute, over the symbols that are known at it.
        handed: For each stage the numbers that it passes on.
        used: For each stage the symbols that it uses.
    """
    given = [one for stage in inputs[: s + 1] for one in stage]
    ins: dict[Any, ca.SX] = {name: x for name, x, own in given if not used[s].isdisjoint(own)}
    outs: dict[Any, ca.SX] = dict(wanted)
    for t in range(len(inputs)):
        passed = [one for one in handed[min(s, t)] if one.known_as in used[max(s, t)]]
        if passed and t < s:
            ins["from", t] = pack([one.symbol for one in passed])
        elif passed and t > s:
            outs["to", t] = pack([one.value for one in passed])
    return Stage(tuple(ins), tuple(outs), ca.Function(f"stage_{s}", [*ins.values()], [*outs.values()]))


def _symbols(*columns: ca.SX) -> set[int]:
    """Return what identifies the symbols in some columns."""
    return {symbol.element_hash() for symbol in ca.symvar(ca.vertcat(ca.SX(0, 1), *columns))}


@dataclass(frozen=True, eq=False)
class WrittenModule:
    """The stages of one module's model, and the coordinates that they read.

    Attributes:
        q, v: Coordinates and freedoms of the spanning tree in the inputs "q" and "v" (and "a").
        at: Freedoms in other inputs and outputs, by name: of the spanning tree in "a_core", "a_legs" and
            "a_wrists", of the tree after the cuts in "tau" and "laws".
        held: What a balance of forces holds of its loops, or how a direct model answers to friction that
            grows with load; None of other models.
    """

    stages: list[Stage]
    q: Index
    v: Index
    at: dict[str, Index]
    held: Handed | None = None


def begun(
    plan: ModulePlan, options: Options, given: GivenColumns, *, accelerations: bool = False
) -> tuple[Core, tuple[Expression, Expression, Any], tuple[Expression, Any]]:
    """Write the motion of a module's core.

    Args:
        given: Filled with the symbols that it is written in.
        accelerations: Whether accelerations are given.

    Returns:
        The core; q, v and a of the spanning tree; twist and acceleration of the base. Accelerations that are
        not given are None.
    """
    tree, (at_q, at_v) = plan.mechanism.spanning, read_by_core(plan)
    q, v = given.scattered("q", at_q, tree.nq), given.scattered("v", at_v, tree.nv)
    a = given.scattered("a", at_v, tree.nv) if accelerations else None
    given |= {} if plan.column is None else {"parameters": plan.column}
    base = given.base_twist(options), given.base_acceleration(options) if accelerations else None
    return write_core(plan, q, v, base[0], a, base[1]), (q, v, a), base


def twist_width(velocity: bool) -> int:
    """Return the size of a base's twist: 3 for its angular part, or 6 (`GivenColumns.base_twist`)."""
    return 3 if velocity else 6


def read_by_core(plan: ModulePlan) -> tuple[Index, Index]:
    """Return the coordinates and freedoms of the spanning tree that a core reads."""
    parts = plan.parts
    every = [parts, *parts.paths]
    q, v = (np.unique(np.concatenate(own)) for own in ([x.q for x in every], [x.v for x in every]))
    return q[q >= 0], v[v >= 0]
