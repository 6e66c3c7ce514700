"""Guards of the inverse recursion: lost rank, lost digits, and the other branches where rank is lost."""

from __future__ import annotations

import numpy as np

from ..linkage.reduction import Basis
from ..spatial import Array
from ..structure.robot import HybridRobot
from ..structure.state import ModuleState, RobotMotion
from .actuation import Need, Sharing, motor_efforts
from .inverse_recursion import ModuleForces
from .lost_digits import robot_weight, warn_of_lost_efforts
from .lost_rank import LOST_PIVOT, along_motion, possible_motions, refuse_lost_digits, refuse_lost_rank
from .natural_sizes import force_rounding


class Guards:
    """What the inverse recursion refuses, for one motion of a robot.

    Attributes:
        sharing: How motors share the load, or None where efforts are known and nothing is refused.
    """

    def __init__(self, robot: HybridRobot, motion: RobotMotion, sharing: Sharing | None) -> None:
        """Compute the sizes that rounding is measured by.

        Args:
            robot: The robot.
            motion: Its motion.
            sharing: How motors share the load, or None where efforts are known.
        """
        self.sharing = sharing
        self._robot, self._weight = robot, robot_weight(robot)
        self._rounding = force_rounding(robot, motion.v, motion.a)
        #: For each module and output the sum of the sizes of what stands on it, shape (T, outputs), [N m].
        self._summed = [np.zeros((len(motion.q), len(module.outputs))) for module in robot.modules]

    def motions(self, s: ModuleState) -> Basis:
        """Return the motions of a module, those of its branch where closures lose rank.

        Args:
            s: State of the module.

        Raises:
            SingularityError: Closures lose rank, and singular postures are refused; or a velocity lies on no
                branch.
        """
        basis = s.mechanism.basis(s.K)
        if self.sharing is not None and self.sharing.on_singular == "raise":
            refuse_lost_rank(s.module, basis)
        return along_motion(s, basis)

    def efforts(self, k: int, s: ModuleState, needed: ModuleForces) -> Array:
        """Compute the efforts of the motors of module k.

        Args:
            k: Number of the module.
            s: Its state.
            needed: Forces that its motion needs.

        Returns:
            Efforts, shape (T, motors of the module), [N or N m].

        Raises:
            SingularityError: No digit of the efforts is left, or the motors lose a direction.
            ActuationError: A passive motion would need an effort.
        """
        assert self.sharing is not None
        module, m, basis, Q = s.module, s.mechanism, needed.basis, needed.Q
        size = self._size(k, s, needed)
        refuse_lost_digits(module, basis, Q, size, self._weight * m.length)
        warn_of_lost_efforts(module, Q, size, self._weight * m.length)
        need = Need(Q, size, self._rounding, s.motion)
        tau = motor_efforts(self._robot, module, basis.Psi, need, self.sharing)
        for t in np.flatnonzero(basis.pivot < LOST_PIVOT) if m.reduction.rank else ():
            # No branch is known: the motors hold every motion that is possible there.
            at = slice(t, t + 1)
            every = possible_motions(module, s.K[t])[None]
            Q_all = np.einsum("tij,ti->tj", every, needed.H[at])
            need = Need(Q_all, size[at], self._rounding[at], s.motion.take(np.array([t])))
            tau[t] = motor_efforts(self._robot, module, every, need, self.sharing)[0]
        return tau

    def _size(self, k: int, s: ModuleState, needed: ModuleForces) -> Array:
        """Compute the largest term that Q was summed from, shape (T,), [N m], and hand it on to the base."""
        m = s.mechanism
        size = np.abs(needed.legs * m.reduction.col_scale).max(axis=1, initial=0.0)
        for o, (F_p, F_e) in enumerate(zip(needed.F_p, needed.F_e, strict=True)):
            size = size + _work(F_p, m.length) + _work(F_e, m.length) + self._summed[k][:, o]
        if s.module.parent >= 0:
            self._summed[s.module.parent][:, s.module.parent_output] += size
        out: Array = size
        return out


def _work(W: Array, length: float) -> Array:
    """Compute the size of a wrench as work per scaled coordinate, shape (T,), [N m]."""
    out: Array = np.linalg.norm(W[:, :3], axis=1) * length + np.linalg.norm(W[:, 3:], axis=1)
    return out
