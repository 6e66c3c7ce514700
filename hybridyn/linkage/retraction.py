"""Local coordinates about a posture: the retraction q = move(q_0, xi) and the rate of xi.

`move` is `Tree.integrate` for a single sample. With q = move(q_0, xi), xi_dot = T(xi)^-1 v, where T is the
identity for joints with one freedom and the right Jacobian of SO(3) for rotations.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..spatial import Array, hat, rotation_from_vector
from .joints import NV, TreeJoint
from .tree import Tree

#: Below this angle [rad] the series of the right Jacobian's inverse is exact to rounding.
SMALL_ANGLE = 1e-4


class Retraction:
    """Retraction on the joints' manifolds, for one sample.

    Attributes:
        flat: Whether every joint has one freedom, so that xi_dot = v.
    """

    def __init__(self, kinds: Sequence[str]) -> None:
        """Find the joints that turn.

        Args:
            kinds: Kind of each joint, in the order of q, v, as in `HybridRobot.kinds`.
        """
        self._tree = Tree([TreeJoint("", kind) for kind in kinds])  # type: ignore[arg-type]
        joints = list(zip(kinds, self._tree.v_slices, strict=True))
        self._endless = [to.stop - 1 for kind, to in joints if kind in ("continuous", "planar")]
        self._turning = [(kind, to) for kind, to in joints if NV[kind] > 1]
        self.flat = not self._turning

    def move(self, q: Array, xi: Array) -> Array:
        """Compute the posture at a displacement xi from q, shapes (nq,), (nv,)."""
        out: Array = self._tree.integrate(q[None], xi[None])[0]
        return out

    def difference(self, q0: Array, q1: Array) -> Array:
        """Compute the displacement xi with `move(q0, xi) = q1`, shape (nv,)."""
        out: Array = self._tree.difference(q0[None], q1[None])[0]
        return out

    def unwound(self, xi: Array, moved: Array) -> Array:
        """Add whole turns to a displacement xi to bring it nearest to `moved`, shape (nv,)."""
        out = xi.copy()
        at = self._endless
        out[at] += 2 * np.pi * np.round((moved[at] - xi[at]) / (2 * np.pi))
        for kind, to in self._turning:
            r = xi[to.stop - 3 : to.stop]
            angle = float(np.linalg.norm(r))
            if kind != "planar" and angle > 0:
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
            angular, J_inverse = slice(to.stop - 3, to.stop), _right_jacobian_inverse(r)
            out[angular] = J_inverse @ x[angular] if inverse else np.linalg.solve(J_inverse, x[angular])
            if kind == "floating":
                R = rotation_from_vector(r)
                at = slice(to.start, to.start + 3)
                out[at] = (R if inverse else R.T) @ x[at]
        return out


def _right_jacobian_inverse(r: Array) -> Array:
    """Compute the inverse of the right Jacobian, shape (3, 3).

    The right Jacobian maps the rate of a rotation vector to the body's angular velocity. Its own form cancels
    at small angles, this one does not.
    """
    angle, S = float(np.linalg.norm(r)), hat(r)
    if angle < SMALL_ANGLE:
        return np.asarray(np.eye(3) + S / 2 + S @ S / 12)
    factor = (1 - angle / 2 / np.tan(angle / 2)) / angle**2
    return np.asarray(np.eye(3) + S / 2 + factor * S @ S)
