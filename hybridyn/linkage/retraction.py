"""Local coordinates about a posture: the retraction q = move(q_0, xi) and the rate of xi.

`move` is `Tree.integrate` for a single sample. With q = move(q_0, xi), xi_dot = T(xi)^-1 v, where T is the
identity for joints with one freedom and the right Jacobian of SO(3) for rotations.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..spatial import Array, hat, rotation_from_vector
from .joints import TreeJoint

#: Below this angle [rad] the series of the right Jacobian's inverse is exact to rounding.
SMALL_ANGLE = 1e-4


class Retraction:
    """Retraction on the joints' manifolds, for one sample.

    Attributes:
        flat: Whether every joint has one freedom, so that xi_dot = v.
    """

    def __init__(self, kinds: Sequence[str], q_slices: Sequence[slice], v_slices: Sequence[slice]) -> None:
        """Group the joints by kind.

        Args:
            kinds: Kind of each joint, as in `HybridRobot.kinds`.
            q_slices: Slice of q of each joint.
            v_slices: Slice of v of each joint.
        """
        plain = [i for i, kind in enumerate(kinds) if kind in ("revolute", "prismatic")]
        self._q = np.array([q_slices[i].start for i in plain], dtype=int)
        self._v = np.array([v_slices[i].start for i in plain], dtype=int)
        self._others = [
            (TreeJoint("", kind), kind, q_slices[i], v_slices[i])  # type: ignore[arg-type]
            for i, kind in enumerate(kinds)
            if kind not in ("revolute", "prismatic")
        ]
        self._turning = [(kind, to) for _, kind, _, to in self._others if kind != "continuous"]
        self.flat = not self._turning

    def move(self, q: Array, xi: Array) -> Array:
        """Compute the posture at a displacement xi from q, shapes (nq,), (nv,)."""
        out = q.copy()
        out[self._q] += xi[self._v]
        for joint, _, at, to in self._others:
            out[at] = joint.integrate(q[None, at], xi[None, to])[0]
        return out

    def difference(self, q0: Array, q1: Array) -> Array:
        """Compute the displacement xi with `move(q0, xi) = q1`, shape (nv,)."""
        width = len(self._v) + sum(to.stop - to.start for _, _, _, to in self._others)
        xi = np.zeros(width)
        xi[self._v] = q1[self._q] - q0[self._q]
        for joint, _, at, to in self._others:
            xi[to] = joint.difference(q0[None, at], q1[None, at])[0]
        return xi

    def unwound(self, xi: Array, moved: Array) -> Array:
        """Add whole turns to a displacement xi to bring it nearest to `moved`, shape (nv,)."""
        out = xi.copy()
        for _, kind, _, to in self._others:
            if kind in ("continuous", "planar"):
                at = to.stop - 1
                out[at] += 2 * np.pi * np.round((moved[at] - xi[at]) / (2 * np.pi))
                continue
            r = xi[to.stop - 3 : to.stop]
            angle = float(np.linalg.norm(r))
            if angle > 0:
                further = float(moved[to.stop - 3 : to.stop] @ r) / angle - angle
                out[to.stop - 3 : to.stop] += r / angle * (2 * np.pi * np.round(further / (2 * np.pi)))
        return out

    def pull(self, xi: Array, v: Array) -> Array:
        """Compute xi_dot = T(xi)^-1 v, shapes (nv,) and (nv,) or (nv, k)."""
        return self._map(xi, v, inverse=True)

    def push(self, xi: Array, rate: Array) -> Array:
        """Compute v = T(xi) xi_dot, shapes (nv,) and (nv,) or (nv, k)."""
        return self._map(xi, rate, inverse=False)

    def centred(self, xi: Array) -> Array:
        """Express a displacement in coordinates about the midpoint posture, shape (nv,)."""
        if self.flat:
            return xi
        out = xi.copy()
        for kind, to in self._turning:
            if kind == "planar":
                c, s = np.cos(xi[to.stop - 1] / 2), np.sin(xi[to.stop - 1] / 2)
                out[to.start : to.start + 2] = np.array([[c, s], [-s, c]]) @ xi[to.start : to.start + 2]
            elif kind == "floating":
                half = rotation_from_vector(xi[to.stop - 3 : to.stop] / 2)
                out[to.start : to.start + 3] = half.T @ xi[to.start : to.start + 3]
        return out

    def _map(self, xi: Array, x: Array, *, inverse: bool) -> Array:
        if self.flat:
            return x
        out = x.copy()
        for kind, to in self._turning:
            if kind == "planar":
                c, s = np.cos(xi[to.stop - 1]), np.sin(xi[to.stop - 1])
                R = np.array([[c, -s], [s, c]])
                at = slice(to.start, to.start + 2)
                out[at] = (R if inverse else R.T) @ x[at]
                continue
            r = xi[to.stop - 3 : to.stop]
            angular = slice(to.stop - 3, to.stop)
            out[angular] = (_right_jacobian_inverse(r) if inverse else _right_jacobian(r)) @ x[angular]
            if kind == "floating":
                R = rotation_from_vector(r)
                at = slice(to.start, to.start + 3)
                out[at] = (R if inverse else R.T) @ x[at]
        return out


def _right_jacobian(r: Array) -> Array:
    """Compute the right Jacobian, from the rate of a rotation vector to body angular velocity, (3, 3)."""
    angle, S = float(np.linalg.norm(r)), hat(r)
    if angle < SMALL_ANGLE:
        return np.asarray(np.eye(3) - S / 2 + S @ S / 6)
    out: Array = np.eye(3) - (1 - np.cos(angle)) / angle**2 * S + (angle - np.sin(angle)) / angle**3 * S @ S
    return out


def _right_jacobian_inverse(r: Array) -> Array:
    """Compute the inverse of the right Jacobian, shape (3, 3)."""
    angle, S = float(np.linalg.norm(r)), hat(r)
    if angle < SMALL_ANGLE:
        return np.asarray(np.eye(3) + S / 2 + S @ S / 12)
    factor = (1 - angle / 2 / np.tan(angle / 2)) / angle**2
    return np.asarray(np.eye(3) + S / 2 + factor * S @ S)
