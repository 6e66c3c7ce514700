"""Functions of many columns at a state: polar forms of what is quadratic in the rates, and the rate of dq/du.

What is quadratic in the rates has the polar form f(v, w) = (f(v + w) - f(v - w)) / 4, exactly.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...errors import SingularityError
from ...spatial import Array, Index, crm
from ...structure.robot import HybridRobot
from .engine import Engine
from .independent import IndependentCoordinates

#: Samples in one pass of a recursion for many columns.
AT_ONCE = 512


def by_columns(f: Callable[[Array, Array], Array], q: Array, X: Array) -> Array:
    """Compute a function of positions and of one column, for each column of X, in parts of bounded memory.

    Args:
        f: The function of samples (S, nq) and columns (S, n), with results of shape (S, k).
        q: Positions, shape (T, nq).
        X: Columns, shape (T, n, c).

    Returns:
        Shape (T, k, c).

    Raises:
        SingularityError: As f raises, with the number of the sample among the T.
    """
    parts, at_once = [], max(1, AT_ONCE // max(len(q), 1))
    for first in range(0, max(X.shape[2], 1), at_once):
        some = np.swapaxes(X[:, :, first : first + at_once], 1, 2)
        count = some.shape[1]
        try:
            values = f(np.repeat(q, count, axis=0), some.reshape(-1, X.shape[1]))
        except SingularityError as error:
            if error.sample is not None:
                error.sample //= count
            raise
        parts.append(values.reshape(len(q), count, values.shape[1]))
    return np.swapaxes(np.concatenate(parts, axis=1), 1, 2)


def polar_form(robot: HybridRobot, f: Callable[[Array, Array], Array], q: Array, v: Array, E: Array) -> Array:
    """Compute the polar form of a quadratic function of the rates, between v and each column of E.

    Args:
        f: The function of positions (S, nq) and rates (S, nv), with results of shape (S, k).
        q: Positions, shape (T, nq).
        v: Rates, shape (T, nv).
        E: Columns of rates, shape (T, nv, c).

    Returns:
        Shape (T, k, c).
    """
    # Columns are scaled to the size of v, so that no digit is lost between them; as they are at rest.
    speed = np.abs(v / robot.unit).max(axis=1, initial=0.0)[:, None]
    size = np.abs(E / robot.unit[:, None]).max(axis=1, initial=0.0)
    factor = np.where((speed > 0) & (size > 0), speed / np.where(size > 0, size, 1.0), 1.0)[:, None]

    def difference(state: Array, w: Array) -> Array:
        """Compute f(v + w) - f(v - w)."""
        x, rates = state[:, : robot.nq], state[:, robot.nq :]
        both = f(np.repeat(x, 2, axis=0), np.stack([rates + w, rates - w], axis=1).reshape(-1, robot.nv))
        return both[::2] - both[1::2]

    out: Array = by_columns(difference, np.concatenate([q, v], axis=1), E * factor) / (4 * factor)
    return out


def rate_of_map(engine: Engine, q: Array, v: Array, E: Array) -> Array:
    """Compute E_dot by polarisation of the drift E_dot(v) u, which is quadratic in v, shape (T, nv, N).

    The columns of u are derivatives of one posture by coordinates, so that d(E_j)/du_i and d(E_i)/du_j agree
    on joints with one freedom; on the others, whose rates are twists, they differ by the Lie bracket. Modules
    do not depend on each other: the columns of equal number of all modules are computed at once.

    Args:
        q: Positions, shape (T, nq).
        v: Rates, shape (T, nv).
        E: dq/du, shape (T, nv, N).

    Raises:
        SingularityError: The coordinates leave idle motions open.
    """
    robot, u = engine.robot, engine.u
    u.fit(robot, "the rate of dq/du")
    if not u.size:
        return np.zeros_like(E)
    places = blocks(robot, u)
    together = np.zeros((len(q), robot.nv, max(len(own) for _, own, _ in places)))
    for index, own, at in places:
        together[:, index, at] = E[:, index, own]
    form = polar_form(robot, engine.drift, q, v, together)
    out = -_brackets(robot, v, E) / 2
    for index, own, at in places:
        out[:, index, own] += form[:, index, at]
    return out


def blocks(robot: HybridRobot, u: IndependentCoordinates) -> list[tuple[Index, Index, Index]]:
    """Return where the blocks of dq/du are: of each module its rows, its columns, and their numbers in it."""
    return [
        (module.v_index[:, None], own, np.arange(len(own)))
        for module, own in zip(robot.modules, u.own, strict=True)
    ]


def _brackets(robot: HybridRobot, v: Array, E: Array) -> Array:
    """Compute the Lie brackets of the rates with the columns of E, joint by joint, shape (T, nv, N)."""
    out = np.zeros_like(E)
    for i, (kind, at) in enumerate(zip(robot.kinds, robot.v_slices, strict=True)):
        if kind.single or (i == 0 and robot.base != "fixed"):
            continue
        S = kind.columns
        V, U = np.zeros((len(v), 1, 6)), np.zeros((len(v), E.shape[2], 6))
        V[..., 0, S] = v[:, at]
        U[..., S] = np.swapaxes(E[:, at], 1, 2)
        out[:, at] = np.swapaxes(crm(np.broadcast_to(V, U.shape), U)[..., S], 1, 2)
    return out
