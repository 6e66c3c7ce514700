"""Pinocchio's joints, inertias, and model of the spanning tree of a whole robot."""

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from ..description.joint_words import WORDS
from ..errors import ModelError
from ..joints.kinds import JointKind
from ..linkage.joints import TreeJoint
from ..spatial import Array
from .bodies import Bodies, Body, BodyJoint

#: Largest number of joints. The memory of Pinocchio's `Model` grows with its square, that of `Data` with its
#: cube.
MOST_JOINTS = 10_000


def pinocchio_joint(joint: TreeJoint) -> pin.JointModel:
    """Return the Pinocchio joint of a `TreeJoint`, of an axis-aligned type if the axis allows it."""
    name, *others = WORDS[joint.kind].pinocchio
    letter = next((letter for letter, x in zip("XYZ", joint.axis, strict=True) if x == 1.0), "")
    numbers = (joint.pitch,) if joint.kind is JointKind.SCREW else ()
    if not joint.kind.single or letter:
        return getattr(pin, f"JointModel{name}{letter if joint.kind.single else ''}")(*numbers)
    if joint.kind is JointKind.CONTINUOUS:
        return _continuous(joint.axis)
    return getattr(pin, f"JointModel{others[0]}")(joint.axis, *numbers)


def _continuous(axis: Array) -> pin.JointModel:
    """Return a continuous joint about any axis, by the URDF reader, because Python cannot set the axis."""
    x, y, z = (float(value) for value in axis)
    return pin.buildModelFromXML(
        '<robot name="one"><link name="a"/><link name="b"><inertial><mass value="1"/>'
        '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        f'<joint name="j" type="{JointKind.CONTINUOUS}"><parent link="a"/><child link="b"/>'
        f'<axis xyz="{x!r} {y!r} {z!r}"/></joint></robot>'
    ).joints[1]


def pinocchio_inertia(body: Body) -> pin.Inertia:
    """Return Pinocchio's inertia of a body.

    The entries are set one by one, because the constructor rejects unphysical inertias.
    """
    out = pin.Inertia.Zero()
    out.mass = body.mass
    out.lever = body.com
    # Symmetric to the last digit, because Pinocchio checks symmetry with an absolute tolerance.
    out.inertia = (body.inertia + body.inertia.T) / 2
    return out


def build_model(bodies: Bodies, joints: Sequence[str], base: str, gravity: Array, name: str) -> pin.Model:
    """Build the model with joints depth-first, siblings by name, and one operational frame per link.

    Args:
        bodies: The robot's bodies and the joints between them.
        joints: Names of the movable joints, "root_joint" first unless the base is fixed.
        base: "fixed", "moving" or "floating".
        gravity: Acceleration of gravity in the world, shape (3,), [m/s^2].
        name: Name of the robot.

    Raises:
        ModelError: The robot has more than `MOST_JOINTS` joints.
    """
    if len(joints) > MOST_JOINTS:
        raise ModelError(
            f"robot '{name}' has {len(joints)} joints; a Pinocchio model is refused above {MOST_JOINTS} "
            "joints (its memory grows with the square of their number); use hybridyn's own functions"
        )
    model = pin.Model()
    model.name = name
    model.gravity.linear = gravity
    number = {0: 0}
    if base != "fixed":
        number[0] = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), joints[0])
        model.addJointFrame(number[0])
    model.appendBodyToJoint(number[0], pinocchio_inertia(bodies.bodies[0]), pin.SE3.Identity())
    for j in bodies.joints:
        number[j.child] = _add_joint(model, number[j.parent], j, bodies.bodies[j.child])
    for link, (body_number, R, p) in bodies.place.items():
        model.addBodyFrame(link, number[body_number], pin.SE3(np.asarray(R), np.asarray(p)), 0)
    return model


def _add_joint(model: pin.Model, parent: int, j: BodyJoint, body: Body) -> int:
    """Add a joint with its limits and the inertia of its child; return its number."""
    joint = j.in_tree(j.joint.name, j.parent)
    number = model.addJoint(parent, pinocchio_joint(joint), pin.SE3(j.R, j.p), joint.name)
    model.addJointFrame(number)
    model.appendBodyToJoint(number, pinocchio_inertia(body), pin.SE3.Identity())
    added = model.joints[number]
    if added.nv == 1:
        model.velocityLimit[added.idx_v] = j.joint.velocity
        model.effortLimit[added.idx_v] = j.joint.effort
    if added.nv == added.nq == 1:
        model.lowerPositionLimit[added.idx_q] = j.joint.lower
        model.upperPositionLimit[added.idx_q] = j.joint.upper
    return int(number)
