"""One module's graph: the symbols it is written over, and the stages it is cut into."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from ...spatial import Index
from .core import Plan
from .expressions import Expression, plain, symbols, zeros
from .stages import Stage


@dataclass(frozen=True)
class WrittenModule:
    """The stages of one module's model, and which coordinates they read.

    Attributes:
        stages: The stages.
        q, v: Coordinates of the spanning tree that the inputs "q" and "v" (and "a") hold.
        platforms: Links of the core that are platforms, in the order of the outputs "platform i".
    """

    stages: list[Stage]
    q: Index
    v: Index
    platforms: tuple[int, ...]


@dataclass(frozen=True)
class BaseMotion:
    """Motion of the body that a module stands on, as symbols, or the constants of a base at rest.

    Attributes:
        V: Twist, shape (6,), own frame.
        A: Acceleration less gravity, shape (6,), own frame.
        V_column, A_column: Their symbols by name, "V_base" and "A_base"; nothing for a base at rest.
    """

    V: Expression
    A: Expression
    V_column: dict[str, ca.SX]
    A_column: dict[str, ca.SX]


def base_motion(at_rest: tuple[float, ...] | None, velocity: bool) -> BaseMotion:
    """Return the motion of a module's base.

    Every module is written as an observer sees it who moves with its base's origin, so that only the base's
    rotation counts, and no digit is spent on a velocity that all share. Without velocity terms the model is
    not the same for all observers, and the whole twist is taken.

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
    """Return how many numbers tell the twist of a base: its rotation, or all six (`base_motion`)."""
    return 3 if velocity else 6


def read_by_core(plan: Plan) -> tuple[Index, Index]:
    """Return the coordinates and freedoms of the spanning tree that a core reads."""
    parts = plan.parts
    out = []
    for own, paths in ((parts.q, [p.q for p in plan.paths]), (parts.v, [p.v for p in plan.paths])):
        out.append(np.unique(np.concatenate([own[own >= 0], *paths]).astype(int)))
    return out[0], out[1]


def parameters_of(plan: Plan) -> dict[str, ca.SX]:
    """Return the inertial parameters of a module's bodies where they are inputs."""
    own = plan.parts.own
    return {} if own is None else {"parameters": ca.vertcat(*[x for numbers in own for x in numbers])}


def scattered(name: str, index: Index, width: int) -> tuple[ca.SX, Expression]:
    """Return symbols for some entries of a vector, and the vector with zeros elsewhere."""
    column, entries = symbols(name, len(index))
    out = zeros(width)
    out[index] = entries
    return column, out
