"""Measures of a posture: conditioning, and the efforts that hold a wrench on a link, or the weight.

Let t be the twist of the link relative to another, in an orthonormal basis of the twists that the modules
between them allow, and q_dot the least rates of their motors that move the link so. Lengths in both are
divided by the length L of the longest module:

    q_dot = J t          conditioning: smallest over largest singular value of J, 0 singular, 1 isotropic
    J^T tau = F          efforts that hold a wrench F on the link; redundant motors share it

Motions of the motors at which the link stays where it is need no effort against F: these rates are orthogonal
to the least ones.

The conditioning is restricted to the velocities of the link's independent coordinates. Angular velocities
are included only if one of these coordinates is an angle. `effort_per_force` is the largest effort of any
motor that holds a force of 1 N at the link's origin in the worst direction; `effort_per_torque` is the same
for 1 N m. The efforts that hold the weight are those of the inverse model at rest.
"""

from __future__ import annotations

import numpy as np

from ...assembly.chain.between import Between
from ...assembly.motor_share import SINGULAR_POSTURE
from ...dynamics.inverse import idm
from ...errors import ActuationError
from ...linkage.targets import COORDINATES
from ...spatial import Array, Mask
from ...structure.robot import HybridRobot
from .link_sweep import LinkSweep

#: Efforts below this part of their norm, or of the weight over the module's length, are rounding: the motors
#: of a Delta, for example, hold no torque, and those of a linkage that lies flat no weight.
NO_EFFORT = 1e-12
#: Singular values of the twists below this part of the largest are rounding: the link does not move.
NO_TWIST = 1e-7


class Measures:
    """Measures postures of the modules between two links. Instances are pickled for other processes.

    Attributes:
        spare: Number of further freedoms: motions of the motors at which the link stays where it is.
    """

    def __init__(self, robot: HybridRobot, sweep: LinkSweep) -> None:
        self.robot, self.sweep = robot, sweep
        self.between = Between.of_pose(robot, sweep.modules, sweep.link, sweep.base)
        self.motors = np.concatenate([robot.modules[k].motor_index for k in sweep.modules])
        twists, rates = self.between.maps(self.between.generic())
        #: Freedoms of the link, at generic postures.
        self.rank = _generic_rank(twists)
        Vt = np.linalg.svd(twists, full_matrices=True)[2]
        self.spare = _generic_rank(np.matmul(rates, np.swapaxes(Vt[:, self.rank :], 1, 2)), rates)

    def __call__(self, q: Array) -> dict[str, Array]:
        """Measure postures.

        Args:
            q: Postures of the robot, shape (T, nq).

        Returns:
            Measures by name, shape (T,) each: "conditioning"; if there are enough motors, "effort_per_force"
            [N/N or N m/N] and "effort_per_torque" [N/(N m) or 1]; and "<motor>/effort", the effort that
            holds the robot's weight [N or N m]. Efforts of singular postures are inf.
        """
        conditioning, holding = self._maps(q)
        out = {"conditioning": conditioning}
        singular = conditioning < SINGULAR_POSTURE
        if holding is not None:
            for name, part in (("effort_per_force", slice(0, 3)), ("effort_per_torque", slice(3, 6))):
                worst = np.linalg.norm(holding[:, :, part], axis=2).max(axis=1)
                worst[worst < NO_EFFORT * np.linalg.norm(holding, axis=(1, 2))] = 0.0
                out[name] = np.where(singular, np.inf, worst)
        for name, effort in self._gravity(q, singular).items():
            out[name] = effort
        return out

    def _maps(self, q: Array) -> tuple[Array, Array | None]:
        """Compute the conditioning, shape (T,), and efforts per wrench, shape (T, motors, 6), base axes."""
        if not len(self.motors) or not self.rank:
            return np.zeros(len(q)), None
        twists, rates = self.between.maps(self.between.motion(q))
        U, s, Vt = np.linalg.svd(twists, full_matrices=True)
        V, rest = np.swapaxes(Vt[:, : self.rank], 1, 2), np.swapaxes(Vt[:, self.rank :], 1, 2)
        U, s = U[:, :, : self.rank], s[:, : self.rank]
        # Twists in coordinates w, t = U w. With the least rates of the motors, q_dot = J w.
        J = np.matmul(rates, V / np.maximum(s, np.finfo(float).tiny)[:, None])
        if self.spare:
            still = np.linalg.svd(np.matmul(rates, rest))[0][:, :, : self.spare]
            J -= np.matmul(still, np.matmul(np.swapaxes(still, 1, 2), J))
        if len(self.motors) < self.rank:
            return np.zeros(len(q)), None
        # Equal powers: (unit tau) . J w = F . t, where t has linear velocities over L.
        wrench = np.swapaxes(U, 1, 2) * np.array([self.between.length] * 3 + [1.0] * 3)
        holding = np.matmul(np.linalg.pinv(np.swapaxes(J, 1, 2)), wrench) / self._units[:, None]
        return self._conditioning(U, J), holding

    @property
    def _units(self) -> Array:
        """What counts as one of the motion of each motor [m or rad]."""
        return np.concatenate([self.between.units(k) for k in self.sweep.modules])

    def _conditioning(self, U: Array, J: Array) -> Array:
        """Compute the conditioning of J over the requested part of the twists U w, shape (T,)."""
        requested = [COORDINATES.index(name) for name in self.sweep.names if name in COORDINATES[:3]]
        if len(requested) < len(self.sweep.names):
            requested += [3, 4, 5]
        U, s, Vt = np.linalg.svd(U[:, requested], full_matrices=False)
        rank = len(self.sweep.names)
        s, Vt = np.maximum(s[:, :rank], np.finfo(float).tiny), Vt[:, :rank]
        values = np.linalg.svd(np.matmul(J, np.swapaxes(Vt, 1, 2) / s[:, None]), compute_uv=False)
        return values[:, rank - 1] / np.maximum(values[:, 0], np.finfo(float).tiny)

    def _gravity(self, q: Array, singular: Mask) -> dict[str, Array]:
        """Compute the motor efforts that hold the robot's weight; empty if motors are missing."""
        if not len(self.motors):
            return {}
        rest = np.zeros((len(q), self.robot.nv))
        try:
            tau = idm(self.robot, q, rest, rest, on_singular="least-norm")[:, self.motors]
        except ActuationError:
            return {}
        weight = np.linalg.norm(self.robot.gravity) * sum(body.mass for body in self.robot.bodies.bodies)
        tau[np.abs(tau) < NO_EFFORT * weight * self.between.length / self._units] = 0.0
        tau = np.where(singular[:, None], np.inf, tau)
        return {f"{self.robot.motors[at]}/effort": tau[:, i] for i, at in enumerate(self.motors)}


def _generic_rank(maps: Array, whole: Array | None = None) -> int:
    """Return the rank of maps at generic postures, shape (T, rows, motions), relative to whole ones."""
    values, largest = (np.linalg.svd(x, compute_uv=False) for x in (maps, maps if whole is None else whole))
    if not values.size or not largest.size:
        return 0
    unit = np.maximum(largest[:, :1], np.finfo(float).tiny)
    return int(np.sum(np.median(values / unit, axis=0) > NO_TWIST))
