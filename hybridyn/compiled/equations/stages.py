"""Cut one graph of expressions into stages that run at different times, and write the symbols of modules.

A model is written as one graph, but some of its inputs are known only at a later stage. Each stage passes
the intermediate results to later stages that need them, so that nothing is computed twice.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from ...spatial import Index
from .core import Plan
from .expressions import Expression, pack, plain, symbols, zeros


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


def cut(inputs: list[dict[str, ca.SX]], outputs: list[dict[str, ca.SX]]) -> list[Stage]:
    """Cut a graph into stages.

    A stage computes whatever its inputs suffice for, also what only a later stage asks for.

    Args:
        inputs: For each stage the columns of symbols that are first known at it, by name.
        outputs: For each stage the columns that it must compute, by name.

    Returns:
        The stages. The inputs of a stage are those it uses, also those of earlier stages.
    """
    whole = iter(ca.cse([ca.densify(column) for columns in outputs for column in columns.values()]))
    wanted = [{name: next(whole) for name in columns} for columns in outputs]
    known: list[ca.SX] = []
    handed: list[list[tuple[ca.SX, ca.SX]]] = []  # by stage: the numbers that it passes on, as symbols
    for s, columns in enumerate(inputs):
        known += columns.values()
        later = [column for stage in wanted[s + 1 :] for column in stage.values()]
        later, own, values = ca.extract_parametric(later, known, {}) if later else ([], [], [])
        known += own
        handed.append(list(zip(own, values, strict=True)))
        left = iter(later)
        wanted[s + 1 :] = [{name: next(left) for name in stage} for stage in wanted[s + 1 :]]
    used = [
        _symbols(*columns.values(), *(value for _, value in passed))
        for columns, passed in zip(wanted, handed, strict=True)
    ]
    stages = []
    for s, columns in enumerate(wanted):
        given = [one for stage in inputs[: s + 1] for one in stage.items()]
        ins: dict[Any, ca.SX] = {name: x for name, x in given if not used[s].isdisjoint(_symbols(x))}
        outs: dict[Any, ca.SX] = dict(columns)
        for t in range(len(inputs)):
            passed = [pair for pair in handed[min(s, t)] if not used[max(s, t)].isdisjoint(_symbols(pair[0]))]
            if passed and t < s:
                ins["from", t] = pack([symbol for symbol, _ in passed])
            elif passed and t > s:
                outs["to", t] = pack([value for _, value in passed])
        function = ca.Function(f"stage_{s}", [*ins.values()], [*outs.values()])
        stages.append(Stage(tuple(ins), tuple(outs), function))
    return stages


def _symbols(*columns: ca.SX) -> set[int]:
    """Return what identifies the symbols in some columns."""
    return {symbol.element_hash() for symbol in ca.symvar(ca.vertcat(ca.SX(0, 1), *columns))}


@dataclass(frozen=True, eq=False)
class WrittenModule:
    """The stages of one module's model, and the coordinates that they read.

    Attributes:
        q, v: Coordinates and freedoms of the spanning tree in the inputs "q" and "v" (and "a").
        platforms: Links of the core that are platforms, in the order of the outputs "platform i".
    """

    stages: list[Stage]
    q: Index
    v: Index
    platforms: tuple[int, ...]


@dataclass(frozen=True)
class BaseMotion:
    """Motion of the base of a module, as symbols, or as constants for a base at rest.

    Attributes:
        V: Twist, shape (6,), own frame.
        A: Acceleration less gravity, shape (6,), own frame.
        V_column, A_column: Their symbols by name, "V_base" and "A_base"; empty for a base at rest.
    """

    V: Expression
    A: Expression
    V_column: dict[str, ca.SX]
    A_column: dict[str, ca.SX]


def base_motion(at_rest: tuple[float, ...] | None, velocity: bool) -> BaseMotion:
    """Return the motion of a module's base.

    Every module is written relative to an observer who moves with its base's origin. So only the base's
    angular velocity matters, and no digits are lost to a common velocity. Without velocity terms the model is
    not the same for all observers, and the whole twist is used.

    Args:
        at_rest: Acceleration (less gravity) of a base at rest, else None.
        velocity: Whether velocity terms are on.
    """
    if at_rest is not None:
        return BaseMotion(zeros(6), plain(at_rest), {}, {})
    V_column, twist = symbols("V_base", twist_width(velocity))
    A_column, A = symbols("A_base", 6)
    V = np.concatenate([zeros(6 - len(twist)), twist])
    return BaseMotion(V, A, {"V_base": V_column}, {"A_base": A_column})


def twist_width(velocity: bool) -> int:
    """Return the size of a base's twist: 3 for its angular part, or 6 (`base_motion`)."""
    return 3 if velocity else 6


def read_by_core(plan: Plan) -> tuple[Index, Index]:
    """Return the coordinates and freedoms of the spanning tree that a core reads."""
    parts = plan.parts
    out = []
    for own, paths in ((parts.q, [p.q for p in plan.paths]), (parts.v, [p.v for p in plan.paths])):
        out.append(np.unique(np.concatenate([own[own >= 0], *paths]).astype(int)))
    return out[0], out[1]


def parameters_of(plan: Plan) -> dict[str, ca.SX]:
    """Return the symbols of a module's arguments, or nothing."""
    return {} if plan.column is None else {"parameters": plan.column}


def scattered(name: str, index: Index, width: int) -> tuple[ca.SX, Expression]:
    """Return symbols for some entries of a vector, and the vector with zeros in its other entries."""
    column, entries = symbols(name, len(index))
    out = zeros(width)
    out[index] = entries
    return column, out
