"""Rigid bodies in expressions: inertias, twists, wrenches and their changes of frame, and links of a tree.

An inertia is ten numbers (m, h, I): mass, first moment m c, inertia about the frame's origin (xx, xy, xz,
yy, yz, zz). Twists and wrenches have their linear part first. A frame is given in its parent by its axes R
and its origin p.

Links have aligned axes and base inertial parameters. Neither changes a force or a motion of the joints. Both
make more numbers zero.
"""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from ...joints.kinds import JointKind
from ...linkage.joints import TreeJoint
from ...spatial import Array, cross, hat, quaternion_from_rotation, slices
from ...structure.bodies import Body
from ...structure.wrists import axis_frame
from ...symbols import Expression, dot, minus, plus, times
from .expressions import (
    ROTATION_ROUNDING,
    TURNED_ROUNDING,
    congruence,
    numbers,
    plain,
    settled,
    snap,
    snap_point,
    symmetric,
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
    cross_terms = plus(dot(hat(p), hat(h)), dot(hat(h), hat(p)))
    mass_terms = np.array([[times(m, x) for x in row] for row in dot(hat(p), hat(p))], dtype=object)
    at = np.array([times(m, x) for x in p], dtype=object)
    return np.concatenate([[m], plus(h, at), upper(minus(minus(turned, cross_terms), mass_terms))])


def inertia_matrix(inertia: Expression) -> Expression:
    """Return an inertia as a spatial matrix, shape (6, 6)."""
    out = zeros(6, 6)
    out[0, 0] = out[1, 1] = out[2, 2] = inertia[0]
    h = hat(inertia[1:4])
    out[:3, 3:], out[3:, :3], out[3:, 3:] = -h, h, symmetric(inertia[4:], 3)
    return out


def momentum(inertia: Expression, V: Expression) -> Expression:
    """Compute the spatial momentum I V, shape (6,)."""
    v, w, h = V[:3], V[3:], inertia[1:4]
    linear = np.array([times(inertia[0], x) for x in v], dtype=object)
    turning = plus(cross(h, v), dot(symmetric(inertia[4:], 3), w))
    return np.concatenate([plus(linear, cross(w, h)), turning])


def matrix_moved(M: Expression, R: Expression, p: Expression) -> Expression:
    """Transform a symmetric spatial inertia matrix from the child's frame to the parent's, shape (6, 6)."""
    a, b, c = congruence(R.T, M[:3, :3]), dot(R, dot(M[:3, 3:], R.T)), congruence(R.T, M[3:, 3:])
    P = hat(p)
    aP = dot(a, P)  # [I 0; P I] [a b; b' c] [I P'; 0 I]
    out = zeros(6, 6)
    out[:3, :3] = a
    out[:3, 3:] = minus(b, aP)
    out[3:, :3] = out[:3, 3:].T
    Pb = dot(P, b)
    out[3:, 3:] = symmetric(upper(minus(plus(plus(c, Pb), Pb.T), dot(P, aP))), 3)
    return out


def resting(V: Expression) -> Expression:
    """Return a twist relative to an observer who moves with the frame's origin: the angular part alone."""
    return np.concatenate([zeros(3), V[3:]])


def classical(V: Expression, A: Expression) -> Expression:
    """Convert a spatial acceleration to the classical one, that of the body's point at the origin."""
    return np.concatenate([plus(A[:3], cross(V[3:], V[:3])), A[3:]])


class BallAxes(NamedTuple):
    """Axes of a ball's child that are not those of the file, and of a frame on its parent.

    Attributes:
        positions: Quaternion between them over that of the file, shape (4, 4).
        rates: The child's axes of the file in its own, shape (3, 3).
    """

    positions: Array
    rates: Array

    @classmethod
    def of(cls, parent: Array, child: Array) -> BallAxes:
        """Return those in which R_parent R(q) R_child is the rotation of the ball, q as in the file."""
        (x, y, z, w), (a, b, c, d) = quaternion_from_rotation(np.stack([parent, child]))
        left = np.array([[w, -z, y, x], [z, w, -x, y], [-y, x, w, z], [-x, -y, -z, w]])
        right = np.array([[d, c, -b, a], [-c, d, a, b], [b, -a, d, c], [-a, -b, -c, d]])
        return cls(snap(left @ right), child.T)


@dataclass(frozen=True, eq=False)
class LinkNumbers(TreeJoint):
    """One joint of a tree and the body that it carries; numbers may be expressions.

    Attributes:
        inertia: Ten numbers of the child's inertia (`rigid`), shape (10,).
        ball: How its coordinates follow from those of the file; None where they are the same.
    """

    inertia: Array = field(default_factory=lambda: np.zeros(10))
    ball: BallAxes | None = None

    @property
    def nv(self) -> int:
        """Number of freedoms."""
        return self.kind.nv


#: Links of some joints of a tree, parents first, by the number of the joint; body i + 1 is the child of i.
Links = dict[int, LinkNumbers]


def links_of(joints: Sequence[TreeJoint], inertias: Sequence[Array] | None = None) -> Links:
    """Return the links of a tree from its joints and its bodies' ten numbers, by default zero."""
    each = [np.zeros(10)] * len(joints) if inertias is None else inertias
    return {
        i: LinkNumbers("", j.kind, j.parent, snap(j.R), j.p, snap(j.axis), j.pitch, inertia)
        for i, (j, inertia) in enumerate(zip(joints, each, strict=True))
    }


def freedoms(links: Links) -> dict[int, slice]:
    """Return the freedoms of each joint among those of all links."""
    return dict(zip(links, slices(link.nv for link in links.values()), strict=True))


def axes_of(links: Links, fixed: Container[int], lines: Mapping[int, Array]) -> list[Array]:
    """Choose axes of bodies so that the axis of every joint of one freedom is a coordinate axis.

    Args:
        fixed: Bodies whose axes must not change.
        lines: Axes of the children of balls that become third axes, by the number of the joint.

    Returns:
        For each body (base first) the new axes in the old axes, shape (3, 3).
    """
    axes = [np.eye(3)]
    for i, link in links.items():
        kept = i + 1 in fixed
        axes.append(np.eye(3) if kept else _own_axes(link, axes[link.parent].T @ link.R, lines.get(i)))
    return axes


def aligned(links: Links, axes: Sequence[Array], balls: Container[int], length: float) -> Links:
    """Return links whose bodies have other axes.

    Args:
        axes: Axes of all bodies, as `axes_of` returns them.
        balls: Joints that are balls whose children's axes change.
        length: Size of the points.
    """
    out = dict[int, LinkNumbers]()
    for i, link in links.items():
        here, placed, ball = axes[i + 1], axes[link.parent].T @ link.R, None
        if i in balls:
            known = _is_rotation(placed)
            ball, placed = BallAxes.of(placed if known else here.T, here), here.T if known else placed
        inertia = np.array(moved(plain(link.inertia), plain(here.T), plain(np.zeros(3))), dtype=float)
        axis = snap(here.T @ link.axis, TURNED_ROUNDING) if link.kind.single else link.axis
        R, p = snap(placed @ here, TURNED_ROUNDING), snap_point(axes[link.parent].T @ link.p, length)
        out[i] = replace(link, R=R, p=p, axis=axis, inertia=inertia, ball=ball)
    return out


def _own_axes(link: LinkNumbers, placed: Array, line: Array | None) -> Array:
    """Return the axes of a joint's child in those of the file, shape (3, 3).

    Args:
        placed: Its axes of the file in its parent, at zero.
        line: As in `axes_of`, or None.
    """
    if line is not None:
        return axis_frame(line)
    if not link.kind.single:
        return np.eye(3)
    if link.kind.slides and _is_rotation(placed):
        turned = np.abs(snap(placed, TURNED_ROUNDING)).max(axis=0).min() < 1.0
        if turned and np.abs(snap(placed @ link.axis, TURNED_ROUNDING)).max() == 1.0:
            return placed.T  # those of its parent
    return axis_frame(link.axis) if np.abs(link.axis).max() < 1.0 else np.eye(3)


def _is_rotation(R: Array) -> bool:
    """Return whether a matrix is known, and a rotation up to rounding: files may state shorter numbers."""
    return R.dtype != object and bool(np.abs(R @ R.T - np.eye(3)).max() < TURNED_ROUNDING)


def regrouped(links: Links, kept: Container[int] = ()) -> tuple[Links, Array]:
    """Move inertial parameters that do not affect a joint's force to the parent body, outermost first.

    Nothing moves over joints in `kept`, whose wrenches stay as they are.

    The force of a revolute joint does not depend on the mass, the first moment along the axis, and an inertia
    (y, y, 0) about it. That of a prismatic joint does not depend on the inertia about the child's origin, and
    that of a spherical joint not on the mass.

    Returns:
        The links, and the ten numbers that are moved to the base, shape (10,).

    Source:
        Reference [34] of Ibrahim & Khalil (2010): base inertial parameters.
    """
    out = links.copy()
    base = np.zeros(10)
    for i in reversed(out):
        if i in kept:
            continue
        link = out[i]
        gone = unfelt(link)
        out[i] = replace(link, inertia=_clean(link.inertia - gone, link.inertia))
        at = settled(moved(numbers(gone), numbers(link.R), numbers(link.p)))
        if link.parent:
            parent = out[link.parent - 1]
            out[link.parent - 1] = replace(parent, inertia=parent.inertia + at)
        else:
            base = base + at
    return out, base


def _clean(inertia: Array, before: Array) -> Array:
    """Set entries of ten numbers to zero that are rounding of the previous ones; expressions stay."""
    if inertia.dtype == object:
        return settled(inertia)
    out = inertia.copy()
    for part in (slice(1, 4), slice(4, 10)):
        size = np.abs(before[part]).max()
        out[part] = np.where(np.abs(out[part]) < ROTATION_ROUNDING * size, 0.0, out[part])
    return out


def unfelt(link: LinkNumbers) -> Array:
    """Return the part of a link's ten numbers that does not affect its joint's force, shape (10,)."""
    gone = np.zeros(10, dtype=link.inertia.dtype)
    if link.kind.hinge and np.abs(link.axis).max() == 1.0:
        k = int(np.argmax(np.abs(link.axis)))
        diagonal = (4, 7, 9)
        gone[0], gone[1 + k] = link.inertia[0], link.inertia[1 + k]
        first, second = (diagonal[i] for i in range(3) if i != k)
        gone[first] = gone[second] = link.inertia[second]
    elif link.kind.slides:
        gone[4:] = link.inertia[4:]
    elif link.kind is JointKind.SPHERICAL:
        gone[0] = link.inertia[0]
    return gone
