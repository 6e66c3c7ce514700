"""Residual, rows and drift of closures of one form, written on numbers or on symbols.

A closure joins frame A on one body and frame B on another. Its rows are the derivatives of its residual,
with r = p_B - p_A, the relative angular velocity w = w_B - w_A and the axes of A and B:

    translation i    A_i . r = 0             row   A_i . (v_B - v_A - w_A x r)
    "fixed"          log(R_A^T R_B) = 0      rows  A_i . w                      i = x, y, z
    "parallel"       A_i . B_z = 0           rows  (B_z x A_i) . w              i = x, y
    "perpendicular"  A_z . B_z = 0           row   (B_z x A_z) . w
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from ..joints.kinds import RotationKind
from ..spatial import (
    Array,
    added,
    compose,
    cross,
    rotate,
    rotate_back,
    rotation_vector,
    run,
    sines,
    subtracted,
    symbolic,
)

#: Axes of frame A in the rotational rows.
TURNING = {"free": slice(0), "perpendicular": slice(2, 3), "parallel": slice(2), "fixed": slice(3)}

#: Entries of frame A's axes or of its coordinates by the axes that are constrained.
_AT = {axes: run(np.array(axes, dtype=int)) for n in range(4) for axes in combinations(range(3), n)}


def normals(rotation: RotationKind, A: Array, z: Array) -> Array:
    """Compute the vectors along which frames A and B of a closure have no relative angular velocity.

    Args:
        rotation: Kind of constraint on the relative rotation.
        A: Axes of frame A, shape (..., 3, 3).
        z: Third axis of frame B, shape (..., 3).

    Returns:
        Shape (..., rotational rows, 3).
    """
    axes = _turning_axes(rotation, A)
    return axes if rotation in ("free", "fixed") else cross(z[..., None, :], axes)


def _turning_axes(rotation: RotationKind, A: Array) -> Array:
    """Return the axes of frame A in the rotational rows, shape (..., rotational rows, 3)."""
    axes: Array = np.swapaxes(A, -1, -2)[..., TURNING[rotation], :]
    return axes


def residual_of(
    translations: Sequence[int], rotation: RotationKind, a: tuple[Array, Array], b: tuple[Array, Array]
) -> Array:
    """Compute the residual of closures of one form, shape (..., rows): metres, then radians.

    On symbols, "fixed" and "parallel" have the sines of their angles, so that nothing is divided by zero.

    Args:
        translations: Axes of frame A along which the origins coincide.
        rotation: Kind of constraint on the relative rotation.
        a: Axes and origin of frame A, shapes (..., 3, 3), (..., 3).
        b: Axes and origin of frame B.
    """
    (A, pa), (B, pb) = a, b
    shift = rotate_back(A, pb - pa)[..., _AT[tuple(translations)]]
    if rotation == "free":
        return shift
    relative = compose(np.swapaxes(A, -1, -2), B)
    if rotation == "fixed":
        turn = (sines if symbolic(relative) else rotation_vector)(relative)
    elif rotation == "perpendicular":
        turn = relative[..., 2:3, 2]
    else:
        turn = relative[..., :2, 2]
        turn = turn if symbolic(relative) else _whole_tilt(turn, relative[..., 2:3, 2])
    return np.concatenate([shift, turn], axis=-1)


def _whole_tilt(tilt: Array, cosine: Array) -> Array:
    """Lengthen vectors from the sine of an angle to the angle, shapes (..., 2) and (..., 1)."""
    sine = np.linalg.norm(tilt, axis=-1, keepdims=True)
    known = sine > 1e-9
    turn: Array = tilt * np.where(known, np.arctan2(sine, cosine) / np.where(known, sine, 1.0), 1.0)
    # Exactly opposite axes do not define a direction of tilt: take x.
    turn[..., 0] += np.pi * (~known & (cosine < 0))[..., 0]
    return turn


class Directions(NamedTuple):
    """Vectors along which frames A and B of closures of one form do not move.

    Attributes:
        axes: Vectors along which they do not move apart, shape (..., translational rows, 3).
        turns: Vectors along which they have no relative angular velocity, shape (..., rotational rows, 3).
    """

    axes: Array
    turns: Array


def directions_of(translations: Sequence[int], rotation: RotationKind, A: Array, z: Array) -> Directions:
    """Compute the directions of the rows of closures of one form; arguments as of `normals`."""
    return Directions(np.swapaxes(A, -1, -2)[..., _AT[tuple(translations)], :], normals(rotation, A, z))


def closed_directions(translations: Sequence[int], rotation: RotationKind, A: Array, z: Array) -> Directions:
    """Return directions that take fewer products than `directions_of`; of a closed loop they say the same.

    Three together may be along any axes, and the third axes of "parallel" frames are one.
    """
    axes, turns = directions_of(translations, rotation, A, z)
    turns = _turning_axes(rotation, A) if rotation == "parallel" else turns
    return Directions(
        np.eye(3) if len(translations) == 3 else axes, np.eye(3) if rotation == "fixed" else turns
    )


def turns_dot(
    rotation: RotationKind, A: Array, z: Array, wa: Array, wb: Array, *, closed: bool = False
) -> Array:
    """Compute the time derivatives of `Directions.turns`, shape (..., rotational rows, 3).

    Args:
        wa, wb: Angular velocities of A and B, shape (..., 3).
        closed: Whether the directions are those of a closed loop.
    """
    axes = _turning_axes(rotation, A)
    turned = cross(wa[..., None, :], axes)
    if rotation == "fixed":
        return 0.0 * turned if closed else turned
    if rotation == "free" or (rotation == "parallel" and closed):
        return turned
    return added(cross(cross(wb, z)[..., None, :], axes), cross(z[..., None, :], turned))


def rows_of(directions: Directions, columns: tuple[Array, Array]) -> Array:
    """Compute the constraint rows of closures over some freedoms, shape (..., rows, freedoms).

    Args:
        directions: Those of the rows.
        columns: For each freedom at unit rate, the velocity of B relative to A at B's origin, and the
            relative angular velocity, each of shape (..., freedoms, 3).
    """
    parts = [
        compose(n, np.swapaxes(column, -1, -2))
        for n, column in zip(directions, columns, strict=True)
        if n.shape[-2]
    ]
    return parts[0] if len(parts) == 1 else np.concatenate(parts, axis=-2)


def slides_of(r: Array, v: Array, a: Array, wa: Array, wda: Array) -> tuple[Array, Array]:
    """Compute how B moves in the axes of A: its velocity, and its acceleration along them, shape (..., 3).

    Args:
        r, v, a: Origin of B less that of A, and its first two time derivatives, shape (..., 3).
        wa, wda: Angular velocity and acceleration of A, shape (..., 3).
    """
    slide = subtracted(v, cross(wa, r))
    swept = subtracted(subtracted(a, cross(wda, r)), cross(wa, v))
    return slide, subtracted(swept, cross(wa, slide))


def drift_of(directions: Directions, turning: Array, slide_dot: Array, w: Array, w_dot: Array) -> Array:
    """Compute the second time derivative of the residual of closed loops, shape (..., rows).

    Args:
        directions: Those of the rows.
        turning: Time derivatives of those of turns, shape (..., rotational rows, 3).
        slide_dot: From `slides_of`, shape (..., 3).
        w, w_dot: Relative angular velocity and acceleration, shape (..., 3).
    """
    turn_dot = added(rotate(directions.turns, w_dot), rotate(turning, w))
    return np.concatenate([rotate(directions.axes, slide_dot), turn_dot], axis=-1)
