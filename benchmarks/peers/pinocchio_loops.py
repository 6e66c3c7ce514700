"""A robot in Pinocchio's words: its spanning tree, its closures at points and welds, and where motors act."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from benchmarks.methods import NotMeasuredError
from hybridyn import HybridRobot
from hybridyn.spatial import Array, Index

#: Velocities: Pinocchio's Data holds several nv^3 tensors, 3 GB there.
MOST = 400


@dataclass(frozen=True)
class Loops:
    """What Pinocchio needs to close a robot's loops. Make one for each algorithm: they keep state in it.

    Attributes:
        model, data: Pinocchio's.
        constraints, constraint_data: The closures.
        motors: Index in v of each motor.
        passive: Index in v of everything else.
    """

    model: pin.Model
    data: Any
    constraints: Any
    constraint_data: Any
    motors: Index
    passive: Index

    def efforts(self, tau: Array) -> Array:
        """Spread the motors' efforts over the tree, shape (nv,)."""
        out = np.zeros(self.model.nv)
        out[self.motors] = tau
        return out


def loops(robot: HybridRobot) -> Loops:
    """Write a robot for Pinocchio.

    Raises:
        NotMeasuredError: It has closures that Pinocchio cannot state.
    """
    model = tree(robot)
    kinds = {"spherical": pin.ContactType.CONTACT_3D, "fixed": pin.ContactType.CONTACT_6D}
    constraints = pin.StdVec_RigidConstraintModel()
    for closure in robot.description.closures:
        kind = kinds.get(closure_kind(robot, closure.name))
        if kind is None:
            raise NotMeasuredError(f"closure '{closure.name}' ({closure.kind}) is neither a point nor a weld")
        ends = []
        for link, frame in ((closure.link_a, closure.frame_a), (closure.link_b, closure.frame_b)):
            at = model.frames[model.getFrameId(link, pin.BODY)]
            ends += [at.parentJoint, at.placement * pin.SE3(frame)]
        constraints.append(pin.RigidConstraintModel(kind, model, *ends, pin.ReferenceFrame.LOCAL))
    data = pin.StdVec_RigidConstraintData()
    for constraint in constraints:
        data.append(constraint.createData())
    motors = robot.motor_v
    return Loops(model, model.createData(), constraints, data, motors, others(motors, robot.nv))


def tree(robot: HybridRobot) -> pin.Model:
    """Return a copy of the spanning tree's model: compiled robots watch the model itself while it is held.

    Raises:
        NotMeasuredError: Couplings hold it.
    """
    if robot.description.couplings:
        raise NotMeasuredError("couplings of joints are no closures for Pinocchio")
    return robot.model.copy()


def closure_kind(robot: HybridRobot, name: str) -> str:
    """Give what a closure is for tools that know points and welds; a plane keeps a hinge's axes parallel."""
    closure = next(c for c in robot.description.closures if c.name == name)
    if (closure.translations, closure.rotation) == ((0, 1, 2), "free"):
        return "spherical"
    if (closure.translations, closure.rotation) == ((0, 1, 2), "fixed"):
        return "fixed"
    if (closure.translations, closure.rotation) == ((0, 1, 2), "parallel") and planar(robot):
        return "spherical"
    return "other"


def planar(robot: HybridRobot) -> bool:
    """Tell whether every joint is a hinge and all axes at home are parallel."""
    if set(robot.kinds) - {"revolute", "continuous"}:
        return False
    model = robot.model
    data = model.createData()
    pin.computeJointJacobians(model, data, robot.home)
    axes = data.J[3:].T
    return bool(np.abs(np.cross(axes, axes[0])).max() < 1e-12)


def others(index: Index, size: int) -> Index:
    """Return what is not in an index."""
    return np.setdiff1d(np.arange(size), index)
