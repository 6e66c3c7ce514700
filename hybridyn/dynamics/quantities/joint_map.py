"""The map between motors and output joints, as a parallel ankle's two motors and its pitch and roll.

With H = d(motors)/d(joints) and G = d(joints)/d(motors), both from the loops, neither as the other's inverse:

    motor rates = H joint rates              joint rates = G motor rates
    joint efforts = H^T motor efforts        motor efforts = G^T joint efforts        (equal power)
    inertia, damping, stiffness of the motors at the joints: H^T diag(...) H

Only the modules that hold the joints take part.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import ArrayLike

from ...assembly.posture import check_joints, holding, modules_of, positions_of, posture_at
from ...errors import TrajectoryError
from ...spatial import Array
from ...structure.robot import HybridRobot
from ...structure.samples import as_batch, as_positions, same_samples
from .engine import closed_states
from .independent import IndependentCoordinates, independent_motions, located
from .polar_forms import polar_form

#: Computes dv/d(side), shape (T, nv, N), and the accelerations at rest of that side, shape (T, nv), at
#: positions (T, nq) and rates (T, nv); without rates the accelerations are zero.
Motions = Callable[[Array, Array | None, IndependentCoordinates], tuple[Array, Array]]


@dataclass(frozen=True, eq=False)
class JointMap:
    """Motors and output joints at a posture; the leading axis T is dropped for a single sample.

    Rates, accelerations and efforts that its functions take have the shape (k,) or (T, k) for the joints, and
    (m,) or (T, m) for the motors. Units are those of the positions, per second, and N or N m.

    Attributes:
        robot: The robot.
        joints: Names of the k output joints.
        motors: Names of the m motors of the same modules.
        q: Positions of the whole robot, shape (T, nq).
        joint_positions: Positions of the joints, shape (T, k), [m or rad].
        motor_positions: Positions of the motors, shape (T, m), [m or rad].
        motors_per_joints: H, rates of the motors over those of the joints, shape (T, m, k).
        joints_per_motors: G, rates of the joints over those of the motors, shape (T, k, m).
        motions: Function that computes motions over one side, for `curvature`.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> found = hybridyn.joint_map(robot, robot.home, ["m1_left_elbow", "m1_right_elbow"])
        >>> found.motors
        ('m1_left_drive', 'm1_right_drive')
        >>> found.motor_rates([1.0, 0.0]).round(3)
        array([-1.237, -0.644])
    """

    robot: HybridRobot = field(repr=False)
    joints: tuple[str, ...]
    motors: tuple[str, ...]
    q: Array
    joint_positions: Array
    motor_positions: Array
    motors_per_joints: Array
    joints_per_motors: Array
    motions: Motions = field(repr=False, compare=False)

    def motor_rates(self, joint_rates: ArrayLike) -> Array:
        """Compute rates of the motors from those of the joints, shape (m,) or (T, m)."""
        return _times(self.motors_per_joints, self._of_joints(joint_rates, "joint_rates"))

    def joint_rates(self, motor_rates: ArrayLike) -> Array:
        """Compute rates of the joints from those of the motors, shape (k,) or (T, k)."""
        return _times(self.joints_per_motors, self._of_motors(motor_rates, "motor_rates"))

    def motor_accelerations(self, joint_rates: ArrayLike, joint_accelerations: ArrayLike) -> Array:
        """Compute accelerations of the motors from the motion of the joints, shape (m,) or (T, m)."""
        along = self._of_joints(joint_accelerations, "joint_accelerations")
        return _times(self.motors_per_joints, along) + self._bend(joint_rates)

    def joint_accelerations(self, motor_rates: ArrayLike, motor_accelerations: ArrayLike) -> Array:
        """Compute accelerations of the joints from the motion of the motors, shape (k,) or (T, k)."""
        along = self._of_motors(motor_accelerations, "motor_accelerations")
        return _times(self.joints_per_motors, along - self._bend(self.joint_rates(motor_rates)))

    def _bend(self, joint_rates: ArrayLike) -> Array:
        """Compute the accelerations of the motors while the joints' rates stay."""
        rates = self._of_joints(joint_rates, "joint_rates")
        out: Array = np.einsum("...ijk,...j,...k->...i", self.curvature, rates, rates)
        return out

    def joint_efforts(self, motor_efforts: ArrayLike) -> Array:
        """Compute efforts at the joints that do the work of motor efforts, H^T tau, shape (k,) or (T, k)."""
        efforts = self._of_motors(motor_efforts, "motor_efforts")
        return _times(np.swapaxes(self.motors_per_joints, -1, -2), efforts)

    def motor_efforts(self, joint_efforts: ArrayLike) -> Array:
        """Compute efforts of the motors that do the work of joint efforts, G^T tau, shape (m,) or (T, m)."""
        efforts = self._of_joints(joint_efforts, "joint_efforts")
        return _times(np.swapaxes(self.joints_per_motors, -1, -2), efforts)

    def at_joints(self, motors: ArrayLike) -> Array:
        """Compute the inertia, damping or stiffness of the motors as felt at the joints, H^T diag(motors) H.

        Args:
            motors: One number for each motor, shape (m,), in its units.

        Returns:
            Symmetric, shape (k, k) or (T, k, k).
        """
        return _congruence(self.motors_per_joints, self._of_motors(motors, "motors", once=True))

    def at_motors(self, joints: ArrayLike) -> Array:
        """Compute the inertia, damping or stiffness of the joints as felt at the motors, G^T diag(joints) G.

        Args:
            joints: One number for each joint, shape (k,), in its units.

        Returns:
            Symmetric, shape (m, m) or (T, m, m).
        """
        return _congruence(self.joints_per_motors, self._of_joints(joints, "joints", once=True))

    def joint_stiffness(self, motor_stiffness: ArrayLike, motor_efforts: ArrayLike) -> Array:
        """Compute the stiffness at the joints, d(joint efforts)/d(joints), of motors that exert efforts.

        K = H^T diag(k) H + sum over motors of tau d2(motor)/d(joints)2. The second term is due to the change
        of H with the posture.

        Args:
            motor_stiffness: Effort of each motor over its displacement, shape (m,).
            motor_efforts: Efforts that the motors exert, shape (m,) or (T, m).

        Returns:
            Symmetric, shape (k, k) or (T, k, k).
        """
        efforts = self._of_motors(motor_efforts, "motor_efforts")
        turned = np.einsum("...i,...ijk->...jk", efforts, self.curvature)
        stiffness = self._of_motors(motor_stiffness, "motor_stiffness", once=True)
        out: Array = _congruence(self.motors_per_joints, stiffness) + turned
        return out

    def _of_joints(self, given: ArrayLike, name: str, *, once: bool = False) -> Array:
        """Return and check numbers of the joints, shape (k,) or (T, k); one for each joint if `once`."""
        return self._checked(given, name, len(self.joints), once)

    def _of_motors(self, given: ArrayLike, name: str, *, once: bool = False) -> Array:
        """Return and check numbers of the motors, shape (m,) or (T, m); one for each motor if `once`."""
        return self._checked(given, name, len(self.motors), once)

    def _checked(self, given: ArrayLike, name: str, width: int, once: bool) -> Array:
        """Return and check an argument.

        Raises:
            TrajectoryError: Its shape is wrong, it has another number of samples than the map, or a number is
                not finite or too large.
        """
        out, single = as_batch(given, width, name)
        if single:
            one: Array = out[0]
            return one
        if once:
            raise TrajectoryError(f"{name} has shape {out.shape}; wanted ({width},), the same at all samples")
        if self.q.ndim == 2:
            same_samples(**{"the map's q": self.q, name: out})
        return out

    @cached_property
    def curvature(self) -> Array:
        """Second derivatives of the motors' positions by the joints', shape (m, k, k) or (T, m, k, k)."""
        q = np.atleast_2d(self.q)
        side = located(self.robot, self.joints, chosen=True)
        motors = located(self.robot, self.motors, chosen=False).columns
        E = self.motions(q, None, side)[0]

        def drift(x: Array, rates: Array) -> Array:
            """Compute the motors' accelerations at zero accelerations of the joints."""
            return self.motions(x, rates, side)[1][:, motors]

        bends = [polar_form(self.robot, drift, q, E[:, :, i], E) for i in range(len(self.joints))]
        out = np.stack(bends, axis=2) if bends else np.zeros((len(q), len(motors), 0, 0))
        out = (out + np.swapaxes(out, 2, 3)) / 2
        return out[0] if self.q.ndim == 1 else out


def joint_map(robot: HybridRobot, q: ArrayLike | Mapping[str, ArrayLike], joints: Sequence[str]) -> JointMap:
    """Compute the map between output joints and the motors of the modules that contain these joints.

    Args:
        robot: The robot.
        q: Positions of the spanning tree, shape (nq,) or (T, nq); or a position, a number or shape (T,), for
            each of the joints or each of those motors, from which the posture is assembled near home.
        joints: Names of the output joints, with one degree of freedom each. A module with output joints must
            have as many of them as degrees of freedom.

    Returns:
        The map, with the positions of both sides.

    Raises:
        AssemblyError: The posture does not close the loops, or is out of reach.
        SingularityError: Joints or motors lose a direction, closures lose rank, or there are more or fewer
            joints or motors than freedoms.
        TrajectoryError: An array has the wrong shape or is not finite, or a joint cannot be a coordinate.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> found = hybridyn.joint_map(robot, robot.home, ["m1_left_elbow", "m1_right_elbow"])
        >>> found.motors_per_joints.round(3)
        array([[-1.237, -0.644],
               [-0.644, -1.237]])
    """
    return related(robot, q, joints, partial(side_motions, robot))


def related(
    robot: HybridRobot, q: ArrayLike | Mapping[str, ArrayLike], joints: Sequence[str], motions: Motions
) -> JointMap:
    """Compute `joint_map` with given motions over each side.

    Args:
        q: As in `joint_map`.
        joints: As in `joint_map`.
        motions: Computes motions over one side.

    Raises:
        HybridynError: As `joint_map` raises.
    """
    names = tuple(joints)
    check_joints(robot, names)
    motors = motors_beside(robot, names)
    q, single = as_positions(robot, posture_at(holding(robot, q), q) if isinstance(q, Mapping) else q)
    outputs = located(robot, names, chosen=True)
    driven = replace(located(robot, motors, chosen=False), mend="Load the robot with motors=[...]")
    for side in (outputs, driven):
        side.fit(robot)
    H = motions(q, None, outputs)[0][:, driven.columns]
    G = motions(q, None, driven)[0][:, outputs.columns]
    arrays = q, positions_of(robot, q, names), positions_of(robot, q, motors), H, G
    q, y, m, H, G = (x[0] if single else x for x in arrays)
    return JointMap(robot, names, motors, q, y, m, H, G, motions)


def motors_beside(robot: HybridRobot, joints: Sequence[str]) -> tuple[str, ...]:
    """Return the motors of the modules that hold joints."""
    modules = modules_of(robot, joints)
    return tuple(m for m in robot.motors if robot.module_of(m) in modules)


def side_motions(
    robot: HybridRobot, q: Array, v: Array | None, side: IndependentCoordinates
) -> tuple[Array, Array]:
    """Compute `Motions` of a robot; modules without joints of the side stay.

    Raises:
        HybridynError: As `joint_map` raises.
    """
    found = independent_motions(robot, closed_states(robot, q, v), q, v, side, others_stay=True)
    return found.E, found.drift


def _times(matrix: Array, vector: Array) -> Array:
    """Return matrix times vector for one sample or many."""
    out: Array = np.einsum("...ij,...j->...i", matrix, vector)
    return out


def _congruence(matrix: Array, diagonal: Array) -> Array:
    """Return matrix^T diag(diagonal) matrix for one sample or many."""
    out: Array = np.einsum("...ij,i,...ik->...jk", matrix, diagonal, matrix)
    return out
