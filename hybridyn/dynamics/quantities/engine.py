"""A closed robot over independent coordinates u: what every quantity is computed from, at many states.

    v = E u,  a = E u_dot + drift                the motions that the loops allow
    tau = M u_dot + c + g                        forces along u, by the recursion of the inverse model

Forces at u_dot = 0 are one pass of Eqs. (30)-(32) at the accelerations `drift`; Q along u is the result.
M is the sum of the inertias of all outputs and legs over u. With a_o, Psi and X of the direct model
(`direct_recursion`) and M_leg of the legs (Eqs. (63)-(75)), in columns of the module's u and of all below it:

    V_o  = X_o V + a_o                                               Eqs. (2), (25): twists over u
    M   += [V; Psi]^T M_leg [V; Psi] + sum_o V_o^T I_o V_o           the kinetic energy of the module
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from ...effects.choice import Choice, Effects, choose, without_losses
from ...errors import ModelError
from ...linkage.motion import Motion
from ...spatial import Array, Index, congruence, motion_matrix
from ...structure.module import ModuleState
from ...structure.robot import HybridRobot
from ..forward import forward
from ..inverse_recursion import needed_forces, output_jacobians
from ..link_motion import all_bodies
from ..loads import Loads, all_loads
from ..state_checks import check_closed
from .independent import IndependentCoordinates, Motions, independent_coordinates, independent_motions

#: Effects that c is made of: what is quadratic in the rates.
QUADRATIC = ("inertia", "leg_inertia", "velocity", "rotor_inertia")


class Engine(Protocol):
    """Motions and forces of a robot over independent coordinates: the general path, or compiled models."""

    @property
    def robot(self) -> HybridRobot:
        """The robot."""
        ...

    @property
    def u(self) -> IndependentCoordinates:
        """Its independent coordinates."""
        ...

    def basis(self, q: Array, v: Array | None = None) -> Array:
        """Compute E = dq/du, shape (T, nv, N); rates v, if given, must keep the loops closed."""
        ...

    def drift(self, q: Array, v: Array) -> Array:
        """Compute the accelerations of the spanning tree at u_dot = 0, shape (T, nv)."""
        ...

    def coriolis(self, q: Array, v: Array) -> Array:
        """Compute c, shape (T, N), [N or N m]."""
        ...

    def mass(self, q: Array) -> Array:
        """Compute the mass matrix, shape (T, N, N)."""
        ...

    def bodies(self, q: Array, v: Array) -> Motion:
        """Compute the motion of all bodies in the world, shapes (T, bodies, ...), at zero accelerations."""
        ...


@dataclass(frozen=True, eq=False)
class GeneralEngine:
    """The engine of the general path.

    Attributes:
        robot: The robot.
        u: Its independent coordinates.
        on: Effects that are computed.
    """

    robot: HybridRobot
    u: IndependentCoordinates
    on: Effects

    @classmethod
    def of(cls, robot: HybridRobot, joints: Sequence[str] | None, effects: Choice = None) -> GeneralEngine:
        """Build the engine for the joints and the effects of a call.

        Raises:
            ModelError: Effects are unknown, without numbers, or prescribe the base's motion.
            TrajectoryError, SingularityError: As `independent_coordinates`.
        """
        return cls(robot, independent_coordinates(robot, joints), chosen_effects(robot, effects))

    def motions(self, q: Array, v: Array | None = None) -> tuple[list[ModuleState], Motions]:
        """Compute the states of the modules, without weights and accelerations, and their motions over u.

        Args:
            q: Positions, shape (T, nq).
            v: Rates, shape (T, nv), or None for zero and no drift.

        Raises:
            AssemblyError: Positions or rates do not close the loops.
            SingularityError: Closures lose rank, or the coordinates are not independent at a sample.
        """
        states = closed_states(self.robot, q, v)
        return states, independent_motions(self.robot, states, q, v, self.u)

    def basis(self, q: Array, v: Array | None = None) -> Array:
        """Compute E = dq/du, shape (T, nv, N); errors are those of `motions`."""
        return self.motions(q, v)[1].E

    def drift(self, q: Array, v: Array) -> Array:
        """Compute the accelerations of the spanning tree at u_dot = 0, shape (T, nv)."""
        states = forward(self.robot, q, v, None, None)
        return independent_motions(self.robot, states, q, v, self.u).drift

    def bias(self, q: Array, v: Array, time: Array | None = None, base: Array | None = None) -> Array:
        """Compute c + g: the generalised force along u at u_dot = 0, shape (T, N), [N or N m].

        Args:
            q: Positions, shape (T, nq).
            v: Rates, shape (T, nv).
            time: Times, shape (T,), [s], or None.
            base: Acceleration of a prescribed base, shape (T, 6), or None for zero.
        """
        robot, on = self.robot, self.on
        loads = all_loads(robot, on, q, v, time, None)
        v = v if on.inertia else np.zeros_like(v)
        bases, _, a = self.motions(q, v)[1]
        if base is not None:
            a[:, :6] = base
        states = forward(robot, q, v, a, on.gravity, classical=on.velocity is not None)
        out = np.zeros((len(q), self.u.size))
        for k, needed in needed_forces(states, loads, lambda k: bases[k]):
            out[:, self.u.own[k]] = needed.Q
        return out

    def coriolis(self, q: Array, v: Array) -> Array:
        """Compute c, shape (T, N): what is quadratic in the rates."""
        return replace(self, on=self.on.only(QUADRATIC)).bias(q, v)

    def bodies(self, q: Array, v: Array) -> Motion:
        """Compute the motion of all bodies in the world, shapes (T, bodies, ...), at zero accelerations."""
        return all_bodies(self.robot, q, v)

    def mass(self, q: Array) -> Array:
        """Compute the mass matrix, shape (T, N, N): the inertias of all outputs and legs, over u."""
        states, motions = self.motions(q)
        none = np.zeros((len(q), self.robot.nv))
        loads = Loads([], np.zeros((len(q), 6)), self.on, none, self.on.rotor_diagonal(self.robot))
        M = np.zeros((len(q), self.u.size, self.u.size))
        twists: list[tuple[Index, Array]] = []
        for s, basis, own in zip(states, motions.bases, self.u.own, strict=True):
            j, o = s.module.parent, s.module.parent_output
            below, V = (own[:0], np.zeros((len(q), 6, 0))) if j < 0 else (twists[j][0], twists[j][1][:, o])
            at = np.concatenate([below, own])
            moved = np.zeros((len(q), 6 + s.mechanism.tree.nv, len(at)))
            moved[:, :6, : len(below)], moved[:, 6:, len(below) :] = V, basis.Psi
            a_maps = np.matmul(output_jacobians(s), basis.Psi[:, None])  # Eq. (2)
            twists.append((at, np.concatenate([motion_matrix(*s.placements) @ V[:, None], a_maps], axis=3)))
            of_outputs = congruence(twists[-1][1], s.mechanism.inertias).sum(axis=1)
            M[:, at[:, None], at] += congruence(moved, loads.leg_matrix(s)) + of_outputs
        return (M + np.swapaxes(M, 1, 2)) / 2


def chosen_effects(robot: HybridRobot, effects: Choice) -> Effects:
    """Return the effects of a call.

    Raises:
        ModelError: They are unknown, without numbers, or prescribe the base's motion.
    """
    on = without_losses(choose(robot, effects).unbounded, "this quantity does not take")
    if on.base is not None:
        raise ModelError(
            f"the effect '{on.base.name}' prescribes the base; here its motion is that of q, v and "
            "base_acceleration",
            element=on.base.name,
        )
    return on


def closed_states(robot: HybridRobot, q: Array, v: Array | None) -> list[ModuleState]:
    """Compute the states of the modules, without weights and accelerations.

    Args:
        q: Positions, shape (T, nq).
        v: Rates, shape (T, nv), or None for zero.

    Raises:
        AssemblyError: Positions or rates do not close the loops.
    """
    rates = np.zeros((len(q), robot.nv)) if v is None else v
    states = forward(robot, q, rates, None, None)
    check_closed(robot, states, q, rates)
    return states
