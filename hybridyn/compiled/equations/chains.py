"""Motion and forces of a tree of links in expressions, every body in its own frame (appendices A to C).

The roots of the tree are the module's base and its platforms, whose motion is given. Twists are absolute:
they include the base's twist. Accelerations are spatial, as in Pinocchio. Maps and matrices are written over
the unknowns

    s = [V_dot_base; y]        y = [q_ddot of joints, V_dot of platforms] in the order of the tree's freedoms

The accelerations of base and platforms in s are absolute and in the base's frame.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ...spatial import crf, crm, cross, hat, motion_to_base, motion_to_body, slices, wrench_to_base
from ...symbols import Expression, dot, is_zero, plus
from .expressions import eye, numbers, zeros
from .rigid import Links, freedoms, inertia_matrix, momentum, moved


@dataclass(frozen=True)
class Placed:
    """Given motion of a platform: axes and origin in the base, twist and acceleration in its own frame."""

    R: Expression
    p: Expression
    V: Expression
    c: Expression


@dataclass
class Chain:
    """Some joints of a tree, with their links, at one posture; body 0 is the base.

    Attributes:
        links: The links; numbers may be expressions.
        platforms: Links whose motion is given.
        R, p: Each child in its parent, by joint.
        R0, p0: Each body in the base.
        S: Motion subspace of each joint, shape (6, nv), child frame.
        V: Twist of each body, own frame.
        c: Acceleration of each body at s = 0, or its whole acceleration if accelerations are given; own
            frame.
        root: Root of each body: 0 or a platform.
    """

    links: Links
    platforms: frozenset[int]
    R: dict[int, Expression] = field(default_factory=dict)
    p: dict[int, Expression] = field(default_factory=dict)
    R0: dict[int, Expression] = field(default_factory=dict)
    p0: dict[int, Expression] = field(default_factory=dict)
    S: dict[int, Expression] = field(default_factory=dict)
    V: dict[int, Expression] = field(default_factory=dict)
    c: dict[int, Expression] = field(default_factory=dict)
    root: dict[int, int] = field(default_factory=dict)

    @property
    def nv(self) -> int:
        """Number of freedoms."""
        return sum(link.nv for link in self.links.values())

    @cached_property
    def q_slices(self) -> dict[int, slice]:
        """Positions of each joint."""
        return dict(zip(self.links, slices(link.kind.nq for link in self.links.values()), strict=True))

    @cached_property
    def v_slices(self) -> dict[int, slice]:
        """Freedoms of each joint."""
        return freedoms(self.links)

    def columns_of(self, root: int) -> list[int]:
        """Return the indices in s of a root's acceleration."""
        at = self.v_slices[root - 1] if root else slice(-6, 0)
        return list(range(6 + at.start, 6 + at.stop))


def sweep(
    links: Links, q: Expression, v: Expression, V_base: Expression, a: Expression | None = None,
    A_base: Expression | None = None, placed: dict[int, Placed] | None = None,
) -> Chain:  # fmt: skip
    """Compute the motion of some joints of a tree, which begin at the base or at platforms.

    Args:
        links: The links.
        q: Positions.
        v: Rates.
        V_base: Twist of the base, own frame.
        a: Accelerations; with them `Chain.c` is the bodies' whole acceleration.
        A_base: Acceleration of the base less gravity, own frame, if accelerations are given.
        placed: Motion of each platform, by its link; its entries of q, v and a are not read.
    """
    placed = placed or {}
    chain = Chain(links, frozenset(placed.keys() & links.keys()))
    chain.R0[0], chain.p0[0], chain.V[0], chain.root[0] = eye(3), zeros(3), V_base, 0
    chain.c[0] = zeros(6) if A_base is None else A_base
    for i, link in links.items():
        at, cols = chain.q_slices[i], chain.v_slices[i]
        if i in placed:
            R, p, V, c = placed[i].R, placed[i].p, placed[i].V, placed[i].c
            R0, p0, S, root = R, p, zeros(6, 6), i + 1
        else:
            turn, shift = link.transform(q[at])
            R, p = dot(numbers(link.R), turn), plus(numbers(link.p), dot(numbers(link.R), shift))
            below, S = chain.R0[link.parent], numbers(link.S)
            rate = dot(S, v[cols])
            V = plus(motion_to_body(R, p, chain.V[link.parent]), rate)
            c = plus(motion_to_body(R, p, chain.c[link.parent]), crm(V, rate))
            c = c if a is None else plus(c, dot(S, a[cols]))
            R0, p0 = dot(below, R), plus(chain.p0[link.parent], dot(below, p))
            root = chain.root[link.parent]
        chain.R[i], chain.p[i], chain.S[i] = R, p, S
        chain.R0[i + 1], chain.p0[i + 1], chain.V[i + 1], chain.c[i + 1] = R0, p0, V, c
        chain.root[i + 1] = root
    return chain


def forces(chain: Chain) -> Expression:
    """Compute the inverse dynamic model of the tree at the accelerations `c`, Eqs. (54)-(62).

    Returns:
        Generalised forces over s, shape (6 + nv,): the wrench of the base on the tree, then H, where a
        platform's entries are its wrench on the bodies that it carries; wrenches in the base's frame.
    """
    wrench, out = carried(chain), zeros(6 + chain.nv)
    for i, cols in reversed(chain.v_slices.items()):
        at = slice(6 + cols.start, 6 + cols.stop)
        if i in chain.platforms:
            out[at] = wrench_to_base(chain.R0[i + 1], chain.p0[i + 1], wrench[i + 1])
        else:
            out[at] = dot(chain.S[i].T, wrench[i + 1])
    out[:6] = wrench[0]
    return out


def carried(chain: Chain) -> dict[int, Expression]:
    """Compute the wrench that each body and those that its joints carry require for their motion, own frame.

    The base requires that of the bodies that stand on it, without platforms.
    """
    wrench = {body: zeros(6) for body in chain.V}
    for i, link in chain.links.items():
        inertia = numbers(link.inertia)
        if any(not is_zero(x) for x in inertia):
            V, A = chain.V[i + 1], chain.c[i + 1]
            wrench[i + 1] = plus(momentum(inertia, A), crf(V, momentum(inertia, V)))
    for i in reversed(chain.links):
        if i not in chain.platforms:
            parent = chain.links[i].parent
            moved = wrench_to_base(chain.R[i], chain.p[i], wrench[i + 1])
            wrench[parent] = plus(wrench[parent], moved)
    return wrench


def mass_matrix(chain: Chain) -> tuple[Expression, Expression]:
    """Compute the mass matrix of the tree over s, Eqs. (63)-(75); A and D of the paper are its blocks.

    Returns:
        M: Mass matrix, shape (6 + nv, 6 + nv); the base's block is left zero.
        S1: The base's block as ten numbers, the composite inertia of the bodies that the base carries.
    """
    composite, M = composites(chain), zeros(6 + chain.nv, 6 + chain.nv)
    cols = {i: list(range(6 + at.start, 6 + at.stop)) for i, at in chain.v_slices.items()}
    for i in reversed(chain.links):
        if i in chain.platforms:
            hanging = moved(composite[i + 1], chain.R0[i + 1], chain.p0[i + 1])
            M[np.ix_(cols[i], cols[i])] = inertia_matrix(hanging)
            continue
        F = np.stack([momentum(composite[i + 1], s) for s in chain.S[i].T], axis=1)
        M[np.ix_(cols[i], cols[i])] = dot(chain.S[i].T, F)
        for rows, block in _inwards(chain, i, F):
            M[np.ix_(rows, cols[i])], M[np.ix_(cols[i], rows)] = block, block.T
    return M, composite[0]


def composites(chain: Chain) -> dict[int, Expression]:
    """Return the ten inertial numbers of each body with those that its joints carry, own frame."""
    out = {0: zeros(10)} | {i + 1: numbers(link.inertia) for i, link in chain.links.items()}
    for i in reversed(chain.links):
        if i not in chain.platforms:
            parent = chain.links[i].parent
            out[parent] = plus(out[parent], moved(out[i + 1], chain.R[i], chain.p[i]))
    return out


def inertial_map(chain: Chain, joint: int) -> Expression:
    """Compute the map from s to the wrench that a joint's child and what that carries require, child frame.

    Returns:
        Shape (6, 6 + nv).
    """
    composite, body = composites(chain), joint + 1
    J, R, p = zeros(6, 6 + chain.nv), chain.R0[body].T, chain.p0[body]
    for k, column in own_columns(chain, body).items():
        J[:, 6 + k] = column
    first = chain.columns_of(chain.root[body])[0]
    J[:3, first : first + 3] = J[3:, first + 3 : first + 6] = R
    J[:3, first + 3 : first + 6] = -dot(R, hat(p))
    out = np.stack([momentum(composite[body], column) for column in J.T], axis=1)
    for other, at in chain.v_slices.items():
        beyond = carriers(chain, other + 1)
        if joint not in beyond[1:]:
            continue
        F = [momentum(composite[other + 1], column) for column in chain.S[other].T]
        for step in beyond[: beyond.index(joint)]:
            F = [wrench_to_base(chain.R[step], chain.p[step], f) for f in F]
        out[:, 6 + at.start : 6 + at.stop] = np.stack(F, axis=1)
    return out


def _inwards(chain: Chain, i: int, F: Expression) -> Iterator[tuple[list[int], Expression]]:
    """Transform the wrenches F of joint i's freedoms inwards; yield indices of s and coupling blocks."""
    slices, root = chain.v_slices, chain.root[i + 1]
    for joint in carriers(chain, i + 1):
        if joint != i:
            at = slices[joint]
            yield list(range(6 + at.start, 6 + at.stop)), dot(chain.S[joint].T, F)
        F = np.stack([wrench_to_base(chain.R[joint], chain.p[joint], f) for f in F.T], axis=1)
    if root:
        F = np.stack([wrench_to_base(chain.R0[root], chain.p0[root], f) for f in F.T], axis=1)
    yield chain.columns_of(root), F


def motion_map(chain: Chain, body: int) -> Expression:
    """Compute the map from s to a body's acceleration without `c`, base's frame, shape (6, 6 + nv)."""
    J, slices = zeros(6, 6 + chain.nv), chain.v_slices
    J[:, chain.columns_of(chain.root[body])] = eye(6)
    for i in carriers(chain, body):
        for k, col in enumerate(range(slices[i].start, slices[i].stop)):
            J[:, 6 + col] = motion_to_base(chain.R0[i + 1], chain.p0[i + 1], chain.S[i][:, k])
    return J


def wrench_map(chain: Chain, body: int) -> Expression:
    """Compute the map from a wrench on a body, own frame, to the base's frame, shape (6, 6)."""
    return np.stack([wrench_to_base(chain.R0[body], chain.p0[body], e) for e in eye(6)], axis=1)


def carriers(chain: Chain, body: int) -> list[int]:
    """Return the joints that carry a body, from its own to that on its root."""
    return [] if body == chain.root[body] else [body - 1, *carriers(chain, chain.links[body - 1].parent)]


def point_map(chain: Chain, body: int, point: Expression) -> Expression:
    """Compute the map from s to the acceleration of a body's point, without `c`, body's axes, (3, 6 + nv)."""
    J, R = zeros(3, 6 + chain.nv), chain.R0[body].T
    for k, column in own_columns(chain, body).items():
        J[:, 6 + k] = point_velocity(column, point)
    J[:, chain.columns_of(chain.root[body])] = np.concatenate(
        [R, -dot(R, hat(plus(chain.p0[body], dot(chain.R0[body], point))))], axis=1
    )
    return J


def own_columns(chain: Chain, body: int) -> dict[int, Expression]:
    """Return the twist of a body, in its own frame, at a unit rate of each freedom that carries it."""
    joints = reversed(carriers(chain, body))
    return columns_through((chain.R[i], chain.p[i], chain.S[i], chain.v_slices[i].start) for i in joints)


def columns_through(
    joints: Iterable[tuple[Expression, Expression, Expression, int]],
) -> dict[int, Expression]:
    """Return the twist of the last of some bodies, in its own frame, at a unit rate of each freedom.

    Args:
        joints: Of each joint, outwards: placement R (3, 3), p (3,) of its child in its parent, motion
            subspace in the child's frame (6, nv), and number of its first freedom.
    """
    columns: dict[int, Expression] = {}
    for R, p, S, first in joints:
        columns = {k: motion_to_body(R, p, column) for k, column in columns.items()}
        columns |= {first + k: column for k, column in enumerate(S.T)}
    return columns


def point_velocity(V: Expression, point: Expression) -> Expression:
    """Compute the velocity of a body's point in the body's axes, shape (3,)."""
    out: Expression = plus(V[:3], cross(V[3:], point))
    return out


def point_acceleration(V: Expression, c: Expression, point: Expression) -> Expression:
    """Compute the classical acceleration of a body's point in the body's axes, shape (3,)."""
    turning = cross(V[3:], point_velocity(V, point))
    out: Expression = plus(plus(c[:3], cross(c[3:], point)), turning)
    return out
