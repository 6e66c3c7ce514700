"""The spin of a leg in its models: nothing drives it, and the leg's closure does not feel it.

Its acceleration s, along the rates S of the leg's joints, follows from

    S^T (M [V_dot_base; q_ddot + S s] + b) = 0

if the spin has inertia; if not, it is zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from ....spatial import Array, Index
from ....structure.wrists import axis_frame
from ....symbols import Expression, dot, plus, times
from ..expressions import Folding, along, scalar, snap
from ..leg_groups import Leg
from ..module_plan import ModulePlan
from ..rigid import Links
from ..rods import UNFELT
from .cores import idle_guard
from .inertia import decided_of, without_forces
from .motion import IdleMotion, first_moment


def other_rates(leg: Leg) -> Array:
    """Return a basis of a leg's joint rates orthogonal to its spin, shape (nv, rows of its closure).

    Of a ball these are the two of its rotation about axes across the rod's line.
    """
    basis = np.eye(len(leg.tree_v))
    if leg.idle is None:
        return basis
    at = list(leg.idle.cols)
    own = snap(axis_frame(leg.idle.axis))[:, :2] if len(at) == 3 else np.zeros((1, 0))
    return np.concatenate([basis[:, : at[0]], basis[:, at] @ own, basis[:, at[-1] + 1 :]], axis=1)


class FreedLeg(NamedTuple):
    """A leg whose spin is free.

    Attributes:
        X: Joint accelerations over the relative motion of the closure's point, with the spin's.
        y0: Those at rest, with the spin's.
        needed: Forces on its joints.
        over_base: Joint accelerations that the spin has over that of the base, shape (nv, 6).
        turned: Inertia about the base's axes that the spin takes away, shape (3, 3).
    """

    X: Expression
    y0: Expression
    needed: Expression
    over_base: Expression
    turned: Expression


@dataclass(frozen=True, eq=False)
class LegIdle:
    """The spin of a group's legs, which share their code.

    Attributes:
        motion: The spin of the first leg.
        S, share: Joint rates at a spin of one, and weights of the spin in joint rates, shape (nv,).
        felt: How far the closure feels the spin, shape (rows,).
        has: 1 for legs whose spin has inertia, else 0.
        certain: Guard that this is certain.
    """

    motion: IdleMotion
    S: Expression
    share: Expression
    felt: Expression
    has: Any = 0.0
    certain: Any = 0.0

    @classmethod
    def of(cls, folding: Folding, group: Sequence[Leg], J: Expression) -> LegIdle | None:
        """Return the spin of a group's legs, or None; J: rows of their closure over joint rates."""
        motions = [leg.idle for leg in group if leg.idle]
        if not motions:
            return None
        n = len(group[0].tree_v)
        S = folding.array([_spread(x.cols, x.axis, n) for x in motions])
        share = folding.array([_spread(x.cols, x.share, n) for x in motions])
        return cls(motions[0], S, share, dot(J, S))

    def decided(
        self, plan: ModulePlan, folding: Folding, group: Sequence[Leg], rotor: Sequence[float]
    ) -> LegIdle:
        """Return the spin with what is decided of its inertia; rotor inertias as for `decided_of`."""
        found = [one for leg in group for one in decided_of(plan, rotor, leg)]
        has, guard = (
            folding.array([scalar(x) for x in each])[0]
            for each in zip(*((one.has, one.guard) for one in found), strict=True)
        )
        return replace(self, has=has, certain=guard)

    def guard(self, plan: ModulePlan, links: Links) -> Any:
        """Return the guard that it is idle, where arguments change the leg of some links."""
        own = replace(self.motion, axis=self.S[list(self.motion.cols)])
        felt = np.concatenate([self.felt[:3] / plan.mechanism.length, self.felt[3:]])
        return idle_guard(plan, felt, first_moment(own, links), UNFELT)

    def unforced(self, plan: ModulePlan, f: Expression, freedoms: Index) -> Any:
        """Return the guard that this is certain, and that nothing acts along a spin without inertia.

        Args:
            f: Forces on the joints before it is free.
            freedoms: The leg's, in the tree after the cuts.
        """
        left = np.array([times(1.0 - self.has, along(self.S, f))], dtype=object)
        return self.certain + without_forces(plan, left, f, freedoms)

    def along(self, a: Expression, H: Expression) -> tuple[Any, Any]:
        """Return the acceleration along it, and the force left: without inertia again the acceleration.

        Args:
            a: Accelerations of the leg's joints.
            H: Forces on them.
        """
        spin = along(self.share, a)
        return spin, self.has * along(self.S, H) + (1.0 - self.has) * spin

    def freed(
        self, inertia: tuple[Expression, Expression], motion: tuple[Expression, Expression], f: Expression
    ) -> FreedLeg:
        """Return what the leg does with a free spin.

        Args:
            inertia: D and A of the leg, Eq. (34).
            motion: X and y0 of the leg without the spin.
            f: Forces on its joints before the spin is free.
        """
        (D, A), (X, y0), S, has = inertia, motion, self.S, self.has
        h, momenta = dot(D, S), dot(A, S)
        per = has / (has * along(S, momenta) + (1.0 - has))
        freed = np.array([[times(-x, per) for x in S]], dtype=object).T  # joint accelerations by a force
        over_base = dot(freed, h[None])
        turned = dot(dot(D[3:], freed), h[None, 3:])  # it moves no mass: nothing of this is linear
        force = np.array([along(S, f)], dtype=object)
        needed = plus(f, dot(dot(A, freed), force))
        return FreedLeg(
            plus(X, dot(freed, dot(momenta[None], X))), plus(y0, dot(freed, force)), needed, over_base, turned
        )


def _spread(cols: Sequence[int], values: Expression, n: int) -> Array:
    """Return a vector with some entries, the others zero, shape (n,)."""
    out = np.zeros(n)
    out[list(cols)] = values
    return out
