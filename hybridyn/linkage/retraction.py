"""Local coordinates about a posture: the retraction q = move(q_0, xi) and the rate of xi.

`move` is `Tree.integrate` for a single sample; `joints.displacement` has the equations of a joint.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ..joints.displacement import centred, pull, push, unwound
from ..joints.kinds import JointKind
from ..spatial import Array
from .joints import TreeJoint
from .tree import Tree


class Retraction:
    """Retraction on the joints' manifolds, for one sample.

    Attributes:
        flat: Whether every joint has one freedom, so that xi_dot = v.
    """

    def __init__(self, kinds: Sequence[JointKind]) -> None:
        """Find the joints that turn.

        Args:
            kinds: Kind of each joint, in the order of q, v, as in `HybridRobot.kinds`.
        """
        self._tree = Tree([TreeJoint("", kind) for kind in kinds])
        self._joints = list(zip(kinds, self._tree.v_slices, strict=True))
        self.flat = all(kind.single for kind in kinds)

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
        return self._by_joint(xi, unwound, xi, moved)

    def pull(self, xi: Array, v: Array) -> Array:
        """Compute xi_dot = T(xi)^-1 v, shapes (nv,) and (nv,) or (nv, k)."""
        return v if self.flat else self._by_joint(v, lambda kind, r, w: pull(kind, r, w.T).T, xi, v)

    def push(self, xi: Array, rate: Array) -> Array:
        """Compute v = T(xi) xi_dot, shapes (nv,) and (nv,) or (nv, k)."""
        return rate if self.flat else self._by_joint(rate, push, xi, rate)

    def centred(self, xi: Array) -> Array:
        """Express a displacement in coordinates about the midpoint posture, shape (nv,)."""
        return xi if self.flat else self._by_joint(xi, centred, xi)

    def _by_joint(self, plain: Array, function: Callable[..., Array], *x: Array) -> Array:
        """Apply a function to each joint that needs more than one number; others keep what is plain."""
        out = plain.copy()
        for kind, at in self._joints:
            if not kind.additive:
                out[at] = function(kind, *(part[at] for part in x))
        return out
