"""Closure residuals and their Jacobian on a module's spanning tree, for Newton's method.

See `linkage.closures`. Unlike the rows of the models (`loops`), these also hold for open loops.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...description.records import RotationKind
from ...linkage.closures import TURNING, TreeClosure, TreeCoupling, normals
from .chains import Chain
from .expressions import Expression, along, cross, dot, plus, zeros
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
        path = set()
        while body:
            path.add(body - 1)
            body = self._chain.links[body - 1].parent
        return path


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
    return total, row
