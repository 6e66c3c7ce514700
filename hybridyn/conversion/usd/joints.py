"""Joints of the tree as UsdPhysics joints: frames, limits, drives, armature, friction, states."""

from __future__ import annotations

import numpy as np

from ...description.placement import angle_of, rotation_to_axis
from ...description.records import Array, Joint
from ...description.usd.schema import AXES, DEGREES
from ..numerals import quaternion_of
from ..request import Losses
from .prims import Prim

#: Types of prims by kind of joint.
TYPES = {
    "fixed": "Fixed", "revolute": "Revolute", "continuous": "Revolute", "prismatic": "Prismatic",
    "spherical": "Spherical", "planar": "",
}  # fmt: skip

#: Free axes of a planar joint.
PLANE = ("transX", "transY", "rotZ")


def add_joint(
    parent: Prim,
    joint: Joint,
    bodies: tuple[Prim, Prim],
    driven: bool,
    home: tuple[float, ...] | None,
    losses: Losses,
) -> Prim | None:
    """Add a joint and return it; None for a floating joint, which USD states by having none.

    Args:
        driven: Whether it is a motor.
        home: Its position at home, None for zero.
        losses: Receives what USD cannot say.
    """
    numbers = joint.damping, joint.friction, joint.rotor_inertia, joint.gear_ratio - 1
    if joint.kind in ("planar", "floating") and any(numbers):
        losses.add("damping, friction and rotors of joints with several freedoms", joint.name)
    if joint.kind == "floating":
        losses.add(
            "floating joints have the name of their link and _free, and start at the world", joint.name
        )
        return None
    out = parent.child(f"Physics{TYPES[joint.kind]}Joint", joint.name)
    single = joint.kind in ("revolute", "continuous", "prismatic")
    token, turn = axis_of(joint.axis) if single else ("", np.eye(3))
    at = joint.placement.copy()
    at[:3, :3] = at[:3, :3] @ turn
    far = np.eye(4)
    far[:3, :3] = turn
    add_ends(out, bodies, (at, far))
    if joint.kind == "continuous":
        losses.add("continuous joints, which USD does not have: read back as hinges", joint.name)
    if joint.kind == "planar":
        losses.add("planar joints are two slides and a hinge", joint.name)
        lock(out, [axis for axis in AXES if axis not in PLANE])
    if single:
        out.line(f'uniform token physics:axis = "{token}"')
        _add_numbers(out, joint, driven, home, losses)
    return out


def add_ends(prim: Prim, bodies: tuple[Prim | None, Prim], frames: tuple[Array, Array]) -> None:
    """Add the bodies of a joint and its frames in them.

    Args:
        bodies: The bodies; None is the world.
        frames: The joint's frame in each, shape (4, 4).
    """
    for side, (body, frame) in enumerate(zip(bodies, frames, strict=True)):
        if body is not None:
            prim.line(f"rel physics:body{side} = <{body.path}>")
        if frame[:3, 3].any():
            prim.numbers("point3f", f"physics:localPos{side}", frame[:3, 3])
        if not np.array_equal(frame[:3, :3], np.eye(3)):
            prim.numbers("quatf", f"physics:localRot{side}", quaternion_of(frame[:3, :3]))


def axis_of(axis: Array) -> tuple[str, Array]:
    """Return the name of the axis of a joint's frame that is the joint's, and this frame, shape (3, 3)."""
    along = [i for i in range(3) if abs(axis[i]) == 1]
    if not along:
        return "Z", rotation_to_axis(axis)
    turn = np.eye(3)
    if axis[along[0]] < 0:  # half a turn about the next axis
        turn = -turn
        turn[(along[0] + 1) % 3] *= -1
    return "XYZ"[along[0]], turn


def lock(prim: Prim, axes: list[str]) -> None:
    """Lock axes of a generic joint: the lower limit is above the upper one."""
    for axis in axes:
        prim.apply(f"PhysicsLimitAPI:{axis}")
        prim.line(f"float limit:{axis}:physics:low = 1")
        prim.line(f"float limit:{axis}:physics:high = -1")


def _add_numbers(
    prim: Prim, joint: Joint, driven: bool, home: tuple[float, ...] | None, losses: Losses
) -> None:
    """Add limits, drive, armature, friction and position of a joint with one freedom."""
    name, unit = ("linear", 1.0) if joint.kind == "prismatic" else ("angular", DEGREES)
    if driven:
        prim.apply(f"PhysicsDriveAPI:{name}")
        prim.line(f'uniform token drive:{name}:physics:type = "force"')
        for word in ("stiffness", "damping"):
            prim.line(f"float drive:{name}:physics:{word} = 0")
    elif np.isfinite(joint.effort_limit):
        losses.add("effort limits of joints without a motor", joint.name)
    drive, engine, axis = f"PhysicsDriveAPI:{name}", "PhysxJointAPI", f"PhysxJointAxisAPI:{name}"
    rows = (
        (joint.lower, "", "physics:lowerLimit", unit),
        (joint.upper, "", "physics:upperLimit", unit),
        (joint.effort if driven else np.inf, drive, f"drive:{name}:physics:maxForce", 1.0),
        (joint.velocity, engine, "physxJoint:maxJointVelocity", unit),
        (joint.armature or np.inf, engine, "physxJoint:armature", 1.0),
        (joint.friction or np.inf, axis, f"physxJointAxis:{name}:staticFrictionEffort", 1.0),
        (joint.friction or np.inf, axis, f"physxJointAxis:{name}:dynamicFrictionEffort", 1.0),
        (joint.damping or np.inf, axis, f"physxJointAxis:{name}:viscousFrictionCoefficient", 1 / unit),
        (
            np.inf if home is None else angle_of(home), f"PhysicsJointStateAPI:{name}",
            f"state:{name}:physics:position", unit,
        ),
    )  # fmt: skip
    for value, schema, attribute, of_file in rows:
        if np.isfinite(value):
            if schema:
                prim.apply(schema)
            prim.numbers("float", attribute, value / of_file)
