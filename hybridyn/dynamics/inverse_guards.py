"""Checks of the inverse recursion: closures that lose rank, efforts without digits, choice of a branch."""

from __future__ import annotations

import numpy as np

from ..linkage.reduction import Basis
from ..spatial import Array
from ..structure.module import ModuleState, RobotMotion
from ..structure.robot import HybridRobot
from .actuation import Need, Sharing, motor_efforts
from .guards import LOST_PIVOT, check_closure_rank, check_effort_digits
from .inverse_recursion import ModuleForces
from .natural_sizes import force_rounding, robot_weight
from .possible_motions import along_motion, possible_motions


class Guards:
    """Checks of the inverse recursion for one motion of a robot.

    Attributes:
        sharing: How the load is distributed among motors, or None if efforts are known and not checked.
    """

    def __init__(self, robot: HybridRobot, motion: RobotMotion, sharing: Sharing | None) -> None:
        """Compute the forces with which rounding is compared.

        Args:
            motion: Motion of the robot.
            sharing: How the load is distributed among motors, or None if efforts are known.
        """
        self.sharing = sharing
        self._robot, self._weight = robot, robot_weight(robot)
        self._rounding = force_rounding(robot, motion.v, motion.a)
        #: For each module, the summed sizes of the modules on each output, shape (T, outputs), [N m].
        self._summed = [np.zeros((len(motion.q), len(module.outputs))) for module in robot.modules]

    def motions(self, s: ModuleState) -> Basis:
        """Compute the motions of a module; if its closures lose rank, those of the branch of its velocity.

        Raises:
            SingularityError: Closures lose rank and `on_singular` is "raise", or a velocity belongs to no
                branch.
        """
        basis = s.mechanism.basis(s.K)
        if self.sharing is not None and self.sharing.on_singular == "raise":
            check_closure_rank(s.module, basis)
        return along_motion(s, basis)

    def efforts(self, k: int, s: ModuleState, needed: ModuleForces) -> Array:
        """Compute the efforts of the motors of module k.

        Returns:
            Efforts, shape (T, motors of the module), [N or N m].

        Raises:
            SingularityError: The efforts have no correct digit, or the motors lose a direction.
            ActuationError: A passive motion would need an effort.
        """
        assert self.sharing is not None
        module, m, basis, Q = s.module, s.mechanism, needed.basis, needed.Q
        size = self._size(k, s, needed)
        check_effort_digits(module, basis, Q, size, self._weight * m.length)
        need = Need(Q, size, self._rounding, s.motion)
        tau = motor_efforts(self._robot, module, basis.Psi, need, self.sharing)
        for t in np.flatnonzero(basis.pivot < LOST_PIVOT) if m.reduction.rank else ():
            # The branch is unknown, so the motors must balance the forces along all possible motions.
            at = slice(t, t + 1)
            every = possible_motions(module, s.K[t])[None]
            Q_all = np.einsum("tij,ti->tj", every, needed.H[at])
            need = Need(Q_all, size[at], self._rounding[at], s.motion.take(np.array([t])))
            tau[t] = motor_efforts(self._robot, module, every, need, self.sharing)[0]
        return tau

    def _size(self, k: int, s: ModuleState, needed: ModuleForces) -> Array:
        """Compute the largest term in the sum Q, shape (T,), [N m], and add it to that of the parent."""
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
