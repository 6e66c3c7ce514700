"""Measures of a module's posture: conditioning, and the efforts that hold a wrench or the weight.

Let t be the twist of the platform relative to the module's base, in an orthonormal basis of the twists that
the loops allow, and q_dot the rates of the module's motors. Lengths in both are divided by the module's
length L:

    q_dot = J t          conditioning: smallest over largest singular value of J, 0 singular, 1 isotropic
    J^T tau = F          efforts that hold a wrench F on the platform; redundant motors share it

The conditioning is restricted to the velocities of the platform's independent coordinates. Angular velocities
are included only if one of these coordinates is an angle. `effort_per_force` is the largest effort of any
motor that holds a force of 1 N at the link's origin in the worst direction; `effort_per_torque` is the same
for 1 N m. The efforts that hold the weight are those of the inverse model at rest.
"""

from __future__ import annotations

import numpy as np

from ...assembly.module_request import place_in_tree
from ...assembly.motor_share import SINGULAR_POSTURE
from ...dynamics.inverse import idm
from ...errors import ActuationError
from ...linkage.targets import COORDINATES
from ...linkage.tree import Motion
from ...spatial import Array, Mask
from ...structure.robot import HybridRobot
from .sweep import Sweep

#: Efforts below this part of their norm, or of the weight over the module's length, are rounding: the motors
#: of a Delta, for example, hold no torque, and those of a linkage that lies flat no weight.
NO_EFFORT = 1e-12
#: Singular values of the twists below this part of the largest are rounding: the platform does not move.
NO_TWIST = 1e-7


class Measures:
    """Measures postures of a module. Instances are pickled for other processes."""

    def __init__(self, robot: HybridRobot, sweep: Sweep) -> None:
        self.robot, self.sweep = robot, sweep
        m = robot.modules[sweep.module].mechanism
        t = self._twists(m.tree.sweep(m.postures), m.basis(m.generic_K).Psi)
        values = np.linalg.svd(t, compute_uv=False)
        #: Freedoms of the platform, at generic postures.
        self.rank = int(np.sum(np.median(values / values[:, :1], axis=0) > NO_TWIST))

    def _twists(self, motion: Motion, Psi: Array) -> Array:
        """Compute the platform's twists of the motions Psi, linear over L, shape (T, 6, N), base axes."""
        m = self.robot.modules[self.sweep.module].mechanism
        number, _, p = place_in_tree(self.robot, self.sweep.link)
        point = motion.p[:, number] + np.matmul(motion.R[:, number], p)
        out: Array = np.matmul(m.tree.jacobian(motion, number, point), Psi)
        out[:, :3] /= m.length
        return out

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
        module = self.robot.modules[self.sweep.module]
        m = module.mechanism
        if not module.motors or not module.mobility:
            return np.zeros(len(q)), None
        motion = m.cut.motion(m.spanning.sweep(q[:, module.q_index]))
        Psi = m.basis(m.closures.matrix(motion)).Psi
        unit = m.reduction.col_scale[module.motor_columns]
        rates = Psi[:, module.motor_columns] / unit[:, None]
        U, s, Vt = np.linalg.svd(self._twists(motion, Psi), full_matrices=False)
        U, s, Vt = U[:, :, : self.rank], s[:, : self.rank], Vt[:, : self.rank]
        # Twists in coordinates w, t = U w. Without the motions that cause no twist, q_dot = J w.
        J = np.matmul(rates, np.swapaxes(Vt, 1, 2) / np.maximum(s, np.finfo(float).tiny)[:, None])
        if len(module.motors) < self.rank:
            return np.zeros(len(q)), None
        # Equal powers: (unit tau) . J w = F . t, where t has linear velocities over L.
        wrench = np.swapaxes(U, 1, 2) * np.array([m.length] * 3 + [1.0] * 3)
        holding = np.matmul(np.linalg.pinv(np.swapaxes(J, 1, 2)), wrench) / unit[:, None]
        return self._conditioning(U, J), holding

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
        module = self.robot.modules[self.sweep.module]
        if not module.motors:
            return {}
        rest = np.zeros((len(q), self.robot.nv))
        try:
            tau = idm(self.robot, q, rest, rest, on_singular="least-norm")[:, module.motor_index]
        except ActuationError:
            return {}
        mechanism = module.mechanism
        weight = np.linalg.norm(self.robot.gravity) * sum(body.mass for body in self.robot.bodies.bodies)
        unit = mechanism.reduction.col_scale[module.motor_columns]
        tau[np.abs(tau) < NO_EFFORT * weight * mechanism.length / unit] = 0.0
        tau = np.where(singular[:, None], np.inf, tau)
        return {f"{name}/effort": tau[:, i] for i, name in enumerate(module.motors)}
