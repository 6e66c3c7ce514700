"""The polar form of what is quadratic in the rates: f(v, w) = (f(v + w) - f(v - w)) / 4, exactly."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...spatial import Array
from ...structure.robot import HybridRobot

#: Samples in one pass of the recursion.
AT_ONCE = 512


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
    T, parts = len(q), []
    scaled, factor = _scaled(robot, v, E)
    at_once = max(1, AT_ONCE // (2 * max(T, 1)))
    for first in range(0, E.shape[2], at_once):
        w = np.swapaxes(scaled[:, :, first : first + at_once], 1, 2)
        moved = np.concatenate([v[:, None] + w, v[:, None] - w], axis=1)
        values = f(np.repeat(q, moved.shape[1], axis=0), moved.reshape(-1, robot.nv))
        both = values.reshape(T, 2, w.shape[1], values.shape[1])
        parts.append((both[:, 0] - both[:, 1]) / (4 * factor[:, first : first + at_once, None]))
    return np.swapaxes(np.concatenate(parts, axis=1), 1, 2) if parts else np.zeros((T, 0, 0))


def _scaled(robot: HybridRobot, v: Array, E: Array) -> tuple[Array, Array]:
    """Scale columns of rates to the size of v, so that no digit is lost between them; as they are at rest.

    Returns:
        The scaled columns, shape (T, nv, c), and their factors, shape (T, c).
    """
    speed = np.abs(v / robot.unit).max(axis=1, initial=0.0)[:, None]
    size = np.abs(E / robot.unit[:, None]).max(axis=1, initial=0.0)
    factor = np.where((speed > 0) & (size > 0), speed / np.where(size > 0, size, 1.0), 1.0)
    return E * factor[:, None], factor
