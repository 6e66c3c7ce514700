"""Residuals and rows of closures over the rates of a whole tree; they hold for open loops, too."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from ...linkage.closures import TreeClosure, directions_of, residual_of, rows_of
from ...spatial import cross, motion_to_base
from ...symbols import Expression, dot, minus, plus
from .chains import Chain, own_columns, point_acceleration, point_velocity
from .expressions import zeros

#: Frames of a closure on its bodies: axes and origin of A, axes and origin of B.
Frames = tuple[Expression, Expression, Expression, Expression]


class SpanningRows:
    """Residuals and Jacobian rows over the rates of a spanning tree at one posture."""

    def __init__(self, chain: Chain) -> None:
        self._chain = chain

    @cached_property
    def _columns(self) -> dict[int, Expression]:
        """Twist of each joint's child at unit rates, at the base's origin, shape (6, nv)."""
        chain = self._chain
        return {
            i: np.stack([motion_to_base(chain.R0[i + 1], chain.p0[i + 1], column) for column in S.T], axis=1)
            for i, S in chain.S.items()
        }

    def closure(self, c: TreeClosure, frames: Frames) -> tuple[Expression, Expression]:
        """Compute a closure's residual, shape (rows,), and Jacobian, shape (rows, nv)."""
        (A, pa), (B, pb) = self._placed(c, frames)
        linear, angular = zeros(self._chain.nv, 3), zeros(self._chain.nv, 3)
        for sign, body, other in ((1.0, c.body_b, c.body_a), (-1.0, c.body_a, c.body_b)):
            for joint in self._path(body) - self._path(other):
                R, at, S = self._chain.R0[joint + 1], self._chain.v_slices[joint], sign * self._chain.S[joint]
                angular[at] = dot(R, S[3:]).T
                lever = cross(angular[at], minus(pb, self._chain.p0[joint + 1]))
                linear[at] = plus(dot(R, S[:3]).T, lever)
        residual = residual_of(c.translations, c.rotation, (A, pa), (B, pb))
        return residual, rows_of(directions_of(c.translations, c.rotation, A, B[:, 2]), (linear, angular))

    def rates(self, c: TreeClosure, frames: Frames, v: Expression) -> Expression:
        """Compute the rates of a closure's residual, its Jacobian times v, from the twists of its bodies.

        The product with the matrix has more operations, and so has its derivative.
        """
        (A, _), (B, pb) = self._placed(c, frames)
        twist = self._twist(c.body_b, c.body_a, v) - self._twist(c.body_a, c.body_b, v)
        at_b = (twist[:3] + cross(twist[3:], pb))[None]
        directions = directions_of(c.translations, c.rotation, A, B[:, 2])
        return rows_of(directions, (at_b, twist[None, 3:]))[:, 0]

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
            out = plus(out, dot(self._columns[joint], v[self._chain.v_slices[joint]]))
        return out

    def _placed(self, c: TreeClosure, frames: Frames) -> Sequence[tuple[Expression, Expression]]:
        """Compute axes and origins of frames A and B of a closure, in the base frame."""
        bodies = ((c.body_a, frames[:2]), (c.body_b, frames[2:]))
        R0, p0 = self._chain.R0, self._chain.p0
        return [(dot(R0[body], R), p0[body] + dot(R0[body], p)) for body, (R, p) in bodies]

    def _path(self, body: int) -> set[int]:
        """Return the joints that carry a body."""
        return {body - 1} | self._path(self._chain.links[body - 1].parent) if body else set()
