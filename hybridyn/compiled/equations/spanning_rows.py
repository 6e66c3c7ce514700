"""Residuals and rows of closures over the rates of a whole tree; they hold for open loops, too."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...joints.kinds import RotationKind
from ...linkage.closures import TURNING, TreeClosure, normals
from ...linkage.couplings import TreeCoupling
from ...spatial import cross
from ...symbols import Expression, dot, minus, plus
from .chains import Chain, own_columns, point_acceleration, point_velocity
from .expressions import along, zeros
from .rigid import motion_to_parent

#: Frames of a closure on its bodies: axes and origin of A, axes and origin of B.
Frames = tuple[Expression, Expression, Expression, Expression]


class SpanningRows:
    """Residuals and Jacobian rows over the rates of a spanning tree at one posture."""

    def __init__(self, chain: Chain) -> None:
        self._chain = chain
        self._columns = [
            [motion_to_parent(chain.R0[i + 1], chain.p0[i + 1], column) for column in S.T]
            for i, S in enumerate(chain.S)
        ]

    def closure(self, c: TreeClosure, frames: Frames) -> tuple[Expression, Expression]:
        """Compute a closure's residual, shape (rows,), and Jacobian, shape (rows, nv)."""
        R_a, p_a, R_b, p_b = frames
        A, pa = self._frame(c.body_a, R_a, p_a)
        B, pb = self._frame(c.body_b, R_b, p_b)
        axes = [A[:, i] for i in c.translations]
        residual = [along(n, pb - pa) for n in axes]
        normals = [np.concatenate([n, cross(pb, n)]) for n in axes]
        for angle, n in _turning(c.rotation, A, B):
            residual.append(angle)
            normals.append(np.concatenate([zeros(3), n]))
        rows = zeros(len(normals), self._chain.nv)
        for sign, body in ((1.0, c.body_b), (-1.0, c.body_a)):
            for joint in self._path(body) - self._path(c.body_a if sign > 0 else c.body_b):
                for k, column in enumerate(self._columns[joint], self._chain.v_slices[joint].start):
                    rows[:, k] = [sign * along(n, column) for n in normals]
        return np.array(residual, dtype=object), rows

    def rates(self, c: TreeClosure, frames: Frames, v: Expression) -> Expression:
        """Compute the rates of a closure's residual, its Jacobian times v, from the twists of its bodies.

        The product with the matrix has more operations, and so has its derivative.
        """
        A, _ = self._frame(c.body_a, frames[0], frames[1])
        B, pb = self._frame(c.body_b, frames[2], frames[3])
        twist = self._twist(c.body_b, c.body_a, v) - self._twist(c.body_a, c.body_b, v)
        at = twist[:3] + cross(twist[3:], pb)
        rates = [along(A[:, i], at) for i in c.translations]
        rates += [along(n, twist[3:]) for _, n in _turning(c.rotation, A, B)]
        return np.array(rates, dtype=object)

    def on_rod(
        self, c: TreeClosure, frames: Frames, turns: Sequence[int], on_line: bool, *, exact: bool = False
    ) -> tuple[Expression, Expression]:
        """Compute `closure` for a rod's end, A, in the rod's axes, with few operations.

        How the rod moves its own end does not depend on where the rod is. The end is taken at A, where the
        closure is once it is closed.

        Args:
            turns: Freedoms that turn the rod about a point of its line.
            on_line: Whether A is on this line; arguments may move it off.
            exact: Whether the rows are derivatives of the residual also where the closure is open, but for
                turns about the line.
        """
        residual, rows = self.closure(c, frames)
        own, slices = own_columns(self._chain, c.body_a), self._chain.v_slices
        beyond = [
            k
            for joint in self._path(c.body_a) - self._path(c.body_b)
            if slices[joint].stop > min(turns, default=self._chain.nv)
            for k in range(slices[joint].start, slices[joint].stop)
        ]
        for k in beyond:
            rows[:, k] = -dot(frames[0].T, point_velocity(own[k], frames[1]))
        if on_line:
            rows[2, list(turns)] = 0.0  # rounding
        for k in beyond if exact else ():
            x, y, _ = dot(frames[0].T, own[k][3:])
            off = cross(np.array([x, y, 0.0], dtype=object), residual)
            rows[:, k] = minus(rows[:, k], off)
        return residual, rows

    def drift(self, c: TreeClosure, frames: Frames) -> Expression:
        """Compute the derivative of a closure's three rows times the chain's rates, which close it."""
        a, b = (
            point_acceleration(self._chain.V[body], self._chain.c[body], p)
            for body, p in ((c.body_a, frames[1]), (c.body_b, frames[3]))
        )
        A = dot(self._chain.R0[c.body_a], frames[0])
        out: Expression = minus(dot(A.T, dot(self._chain.R0[c.body_b], b)), dot(frames[0].T, a))
        return out

    def _twist(self, body: int, other: int, v: Expression) -> Expression:
        """Compute the twist of a body in the base frame, without joints that carry the other body, too."""
        out = zeros(6)
        for joint in sorted(self._path(body) - self._path(other)):
            columns = np.stack(self._columns[joint], axis=1)
            out = plus(out, dot(columns, v[self._chain.v_slices[joint]]))
        return out

    def _frame(self, body: int, R: Expression, p: Expression) -> tuple[Expression, Expression]:
        """Compute axes and origin of a frame on a body, in the base frame."""
        R0 = self._chain.R0[body]
        return dot(R0, R), self._chain.p0[body] + dot(R0, p)

    def _path(self, body: int) -> set[int]:
        """Return the joints that carry a body."""
        return {body - 1} | self._path(self._chain.links[body - 1].parent) if body else set()


def _turning(rotation: RotationKind, A: Expression, B: Expression) -> list[tuple[Any, Expression]]:
    """Return the rotational residuals, each with the axis of its rate."""
    z = B[:, 2]
    if rotation == "fixed":
        pairs = [(1, 2), (2, 0), (0, 1)]
        angles = [0.5 * (along(A[:, j], B[:, i]) - along(A[:, i], B[:, j])) for i, j in pairs]
    else:
        angles = [along(n, z) for n in A.T[TURNING[rotation]]]
    return list(zip(angles, normals(rotation, A, z), strict=True))


def coupling_row(
    chain: Chain, coupling: TreeCoupling, positions: list[Expression], offset: Any
) -> tuple[Any, Expression]:
    """Compute a coupling's residual, and its Jacobian row of shape (nv,)."""
    row, total = zeros(chain.nv), -offset
    for joint, coefficient in coupling.terms:
        at = chain.v_slices[joint].start
        row[at] = row[at] + coefficient
        total = total + coefficient * positions[joint][0]
    if curve := coupling.curve:
        value, slope, _ = curve.at(curve.argument({joint: positions[joint][0] for joint, _ in curve.terms}))
        total = total + value
        for joint, factor in curve.terms:
            at = chain.v_slices[joint].start
            row[at] = row[at] + factor * slope
    return total, row
