"""Postures as frameworks hold them: q as it stands, its displacements, its rates and its angles.

A gradient over q is over its numbers. Quaternions, and cosines with sines, count for their direction alone:
they are normalized first, so that a gradient has no part along them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..joints.kinds import JointKind, Turn
from ..spatial import Array
from ..structure.robot import HybridRobot

#: Which of a joint's arrays: its coordinates in q, or its freedoms in v.
Q, V = 0, 1


def _product(sign: float) -> Array:
    """Return C of the product of two quaternions x, y, z, w, C_ijk p_j r_k, with p's vector times a sign."""
    C = np.zeros((4, 4, 4))
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        C[i, 3, i] = 1.0
        C[i, i, 3] = C[i, j, k] = sign
        C[i, k, j] = C[3, i, i] = -sign
    C[3, 3, 3] = 1.0
    return C


class Charts:
    """The joints' positions in arrays of a framework, shape (..., n)."""

    def __init__(self, robot: HybridRobot, xp: Any, constant: Callable[[Array], Any]) -> None:
        """Divide the joints into those that are numbers, and the others.

        Args:
            robot: The robot.
            xp: The framework's functions on arrays, with the names of NumPy.
            constant: Makes an array of the framework.
        """
        self._robot, self._xp = robot, xp
        places = [*zip(robot.kinds, robot.q_slices, robot.v_slices, strict=True)]
        plain = [(q.start, v.start) for kind, q, v in places if kind.additive]
        self._plain = [[pair[of] for pair in plain] for of in (Q, V)]
        self._others = [(kind, (q, v)) for kind, q, v in places if kind.nv and not kind.additive]
        behind = [[k for _, at in self._others for k in range(at[of].start, at[of].stop)] for of in (Q, V)]
        self._order = [np.argsort(self._plain[of] + behind[of]) for of in (Q, V)]
        self._times, self._back = constant(_product(1.0)), constant(_product(-1.0))

    def normalized(self, q: Any) -> Any:
        """Return q with quaternions, and cosines with sines, of unit length."""

        def one(kind: JointKind, q: Any) -> Any:
            turn = q[..., kind.shift :]
            return self._joined(q[..., : kind.shift], turn / (turn * turn).sum(-1)[..., None] ** 0.5)

        return self._by_joint((Q, Q), lambda q: q, one, q)

    def displacement(self, near: Any, q: Any) -> Any:
        """Return the freedoms' displacement from a posture to one close to it, to second order.

        Moved by it, as Pinocchio's `integrate` does, `near` is q. Both are normalized.
        """

        def one(kind: JointKind, near: Any, q: Any) -> Any:
            n, here, there = kind.shift, near[..., kind.shift :], q[..., kind.shift :]
            if kind.turn is Turn.CIRCLE:
                turn = here[..., :1] * there[..., 1:] - here[..., 1:] * there[..., :1]
            else:
                turn = 2.0 * self._of(self._back, here, there)[..., :3]
            if not n:
                return turn
            way = self._carried(kind, here, q[..., :n] - near[..., :n], back=True)
            return self._joined(way - 0.5 * self._across(kind, turn, way), turn)

        return self._by_joint((Q, Q, V), lambda near, q: q - near, one, near, q)

    def rate(self, q: Any, v: Any) -> Any:
        """Return the time derivative of q, normalized, at rates of the freedoms."""

        def one(kind: JointKind, q: Any, v: Any) -> Any:
            n, turn, w = kind.shift, q[..., kind.shift :], v[..., kind.shift :]
            if kind.turn is Turn.CIRCLE:
                turning = self._joined(-turn[..., 1:] * w, turn[..., :1] * w)
            else:
                turning = 0.5 * self._of(self._times, turn, self._joined(w, 0.0 * w[..., :1]))
            return self._joined(self._carried(kind, turn, v[..., :n]), turning) if n else turning

        return self._by_joint((Q, V, Q), lambda q, v: v, one, q, v)

    def angles(self, q: Any, joints: Sequence[str]) -> Any:
        """Return positions of joints with one freedom, within half a turn for continuous ones, (..., k)."""
        robot, parts = self._robot, []
        for i in map(robot.joint_index.__getitem__, joints):
            x = q[..., robot.q_slices[i]]
            parts.append(x if robot.kinds[i].additive else self._xp.arctan2(x[..., 1:], x[..., :1]))
        return self._joined(*parts)

    def _by_joint(
        self, of: Sequence[int], plain: Callable[..., Any], one: Callable[..., Any], *given: Any
    ) -> Any:
        """Return an array over all joints.

        Args:
            of: Kinds of the given arrays, and of the result, Q or V.
            plain: Computes it for joints that are numbers, all at once.
            one: Computes it for another joint.
            given: Arrays.
        """
        if not self._others:
            return plain(*given)
        parts = [plain(*(x[..., self._plain[kind]] for kind, x in zip(of, given, strict=False)))]
        parts += [
            one(joint, *(x[..., at[kind]] for kind, x in zip(of, given, strict=False)))
            for joint, at in self._others
        ]
        return self._joined(*parts)[..., self._order[of[-1]]]

    def _joined(self, *parts: Any) -> Any:
        """Return arrays behind one another."""
        return self._xp.concatenate(parts, axis=-1)

    def _of(self, product: Any, p: Any, r: Any) -> Any:
        """Return the product of two quaternions."""
        return self._xp.einsum("ijk,...j,...k->...i", product, p, r)

    def _across(self, kind: JointKind, w: Any, x: Any) -> Any:
        """Return the cross product of a turn and a shift."""
        if kind.turn is Turn.CIRCLE:
            return self._joined(-w * x[..., 1:], w * x[..., :1])
        return self._of(self._times[:3, :3, :3], w, x)

    def _carried(self, kind: JointKind, turn: Any, x: Any, *, back: bool = False) -> Any:
        """Turn a shift into the axes of the joint, or back into those of its child."""
        sign = -1.0 if back else 1.0
        if kind.turn is Turn.CIRCLE:
            return turn[..., :1] * x + sign * self._across(kind, turn[..., 1:], x)
        axis = sign * turn[..., :3]
        along = 2.0 * self._across(kind, axis, x)
        return x + turn[..., 3:] * along + self._across(kind, axis, along)
