"""Symbols and stages of one module's graph."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from ...spatial import Index
from .core import Plan
from .expressions import Expression, plain, symbols, zeros
from .stages import Stage


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
