"""Rigid-body algebra in expressions: inertias, twists, wrenches, and their changes of frame.

An inertia is ten numbers (m, h, I): mass, first moment m c, inertia about the frame's origin (xx, xy, xz,
yy, yz, zz). Twists and wrenches have their linear part first. A frame is given in its parent by its axes R
and its origin p.
"""

from __future__ import annotations

import numpy as np

from ...spatial import Array
from ...structure.bodies import Body
from .expressions import (
    Expression,
    congruence,
    cross,
    dot,
    hat,
    numbers,
    plus,
    symmetric,
    times,
    upper,
    zeros,
)


def ten_numbers(body: Body | None) -> Array:
    """Compute the ten numbers of a body's inertia in its frame, shape (10,); zeros for no body."""
    if body is None:
        return np.zeros(10)
    c = np.asarray(body.com, dtype=float)
    about_origin = body.inertia + body.mass * (c @ c * np.eye(3) - np.outer(c, c))
    return np.concatenate([[body.mass], body.mass * c, about_origin[np.triu_indices(3)]])


def ten_expressions(body: Body) -> Expression:
    """Compute `ten_numbers` of a body whose numbers may be expressions."""
    m, c = body.mass, numbers(body.com)
    h = np.array([times(m, x) for x in c], dtype=object)
    return np.concatenate([[m], h, upper(numbers(body.inertia) - dot(hat(c), hat(h)))])


def moved(inertia: Expression, R: Expression, p: Expression) -> Expression:
    """Transform an inertia (ten numbers) from the child's frame to the parent's."""
    m, h, turned = inertia[0], dot(R, inertia[1:4]), congruence(R.T, symmetric(inertia[4:], 3))
    cross_terms = dot(hat(p), hat(h)) + dot(hat(h), hat(p))
    mass_terms = dot(hat(p), hat(p))
    for i in range(3):
        for j in range(3):
            mass_terms[i, j] = times(m, mass_terms[i, j])
    at = np.array([times(m, x) for x in p], dtype=object)
    return np.concatenate([[m], h + at, upper(turned - cross_terms - mass_terms)])


def inertia_matrix(inertia: Expression) -> Expression:
    """Return an inertia as a spatial matrix, shape (6, 6)."""
    out = zeros(6, 6)
    for i in range(3):
        out[i, i] = inertia[0]
    h = hat(inertia[1:4])
    out[:3, 3:], out[3:, :3], out[3:, 3:] = -h, h, symmetric(inertia[4:], 3)
    return out


def momentum(inertia: Expression, V: Expression) -> Expression:
    """Compute the spatial momentum I V, shape (6,)."""
    v, w, h = V[:3], V[3:], inertia[1:4]
    linear = np.array([times(inertia[0], x) for x in v], dtype=object)
    turning = plus(cross(h, v), dot(symmetric(inertia[4:], 3), w))
    return np.concatenate([plus(linear, cross(w, h)), turning])


def to_child(R: Expression, p: Expression, V: Expression) -> Expression:
    """Transform a motion vector from the parent's frame to the child's."""
    return np.concatenate([dot(R.T, plus(V[:3], cross(V[3:], p))), dot(R.T, V[3:])])


def to_parent(R: Expression, p: Expression, F: Expression) -> Expression:
    """Transform a wrench from the child's frame to the parent's."""
    f = dot(R, F[:3])
    return np.concatenate([f, plus(dot(R, F[3:]), cross(p, f))])


def motion_to_parent(R: Expression, p: Expression, V: Expression) -> Expression:
    """Transform a motion vector from the child's frame to the parent's."""
    w = dot(R, V[3:])
    return np.concatenate([plus(dot(R, V[:3]), cross(p, w)), w])


def crm(V: Expression, U: Expression) -> Expression:
    """Compute the cross product V x U of motion vectors, shape (6,)."""
    return np.concatenate([plus(cross(V[3:], U[:3]), cross(V[:3], U[3:])), cross(V[3:], U[3:])])


def crf(V: Expression, F: Expression) -> Expression:
    """Compute the cross product V x* F of a twist and a wrench, shape (6,)."""
    return np.concatenate([cross(V[3:], F[:3]), plus(cross(V[3:], F[3:]), cross(V[:3], F[:3]))])


def matrix_moved(M: Expression, R: Expression, p: Expression) -> Expression:
    """Transform a symmetric spatial inertia matrix from the child's frame to the parent's, shape (6, 6)."""
    a, b, c = congruence(R.T, M[:3, :3]), dot(R, dot(M[:3, 3:], R.T)), congruence(R.T, M[3:, 3:])
    P = hat(p)
    aP = dot(a, P)  # [I 0; P I] [a b; b' c] [I P'; 0 I]
    out = zeros(6, 6)
    out[:3, :3] = a
    out[:3, 3:] = b - aP
    out[3:, :3] = out[:3, 3:].T
    Pb = dot(P, b)
    corner = c + Pb + Pb.T - dot(P, aP)
    rows, cols = np.triu_indices(3)
    corner[cols, rows] = corner[rows, cols]
    out[3:, 3:] = corner
    return out


def resting(V: Expression) -> Expression:
    """Return a twist relative to an observer who moves with the frame's origin: the angular part alone."""
    return np.concatenate([zeros(3), V[3:]])


def classical(V: Expression, A: Expression) -> Expression:
    """Convert a spatial acceleration to the classical one, that of the body's point at the origin."""
    return np.concatenate([plus(A[:3], cross(V[3:], V[:3])), A[3:]])


def quaternion_matrix(q: Expression) -> Expression:
    """Return the rotation matrix of a unit quaternion (x, y, z, w), shape (3, 3)."""
    x, y, z, w = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ],
        dtype=object,
    )
