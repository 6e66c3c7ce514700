"""Joints and closures of USD, of the type that says which axes are free."""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

import numpy as np

from ..description.closure_forms import ROWS
from ..description.joint_words import WORDS
from ..description.placement import angle_of, rotation_to_axis, turned
from ..description.records import Array, Closure, Joint
from ..description.rows import to_state
from ..description.usd.schema import AXES, DEGREES, GENERIC, KINDS, NUMBERS, ONE_AXIS, free_axes
from ..joints.kinds import JointKind, RotationKind
from .as_text import quaternion_of
from .parts import in_words
from .request import FORCES, FREED, Losses, add_of_several, rows_of
from .usd_prim import UsdPrim

#: Types of joints by their free axes; others are generic.
TYPES = {free_axes(kind): word for word, kind in KINDS.items() if not kind.single} | {
    (axis,): word for word, (start, _) in ONE_AXIS.items() for axis in AXES if axis.startswith(start)
}


#: Schemas that attributes need, by the beginning of their names; the axis is filled in.
SCHEMAS = {
    "drive": "PhysicsDriveAPI:{}", "physxJoint": "PhysxJointAPI", "physxJointAxis": "PhysxJointAxisAPI:{}",
    "state": "PhysicsJointStateAPI:{}",
}  # fmt: skip
#: Of several attributes for one number, how that begins which is written.
WRITTEN = ("drive:", "physxJoint:")


class End(NamedTuple):
    """An end of a joint: the body, None for the world, and the joint's frame in it, shape (4, 4)."""

    body: UsdPrim | None
    frame: Array


def start_joint(
    parent: UsdPrim, name: str, free: Collection[str], ends: tuple[End, End], *, closes: bool = False
) -> UsdPrim:
    """Add a joint that moves along some axes, of the type that says so, and return it.

    Args:
        parent: The prim that receives it.
        name: Its name.
        free: The axes, some of `AXES`; a generic joint locks others by a lower limit above the upper one.
        ends: Its ends.
        closes: Whether it closes a loop.
    """
    kind = TYPES.get((*free,), GENERIC)
    out = parent.child(kind, name)
    for side, (body, frame) in enumerate(ends):
        if body is not None:
            out.line(f"rel physics:body{side} = <{body.path}>")
        if frame[:3, 3].any():
            out.numbers("point3f", f"physics:localPos{side}", frame[:3, 3])
        if not np.array_equal(frame[:3, :3], np.eye(3)):
            out.numbers("quatf", f"physics:localRot{side}", quaternion_of(frame[:3, :3]))
    if closes:
        out.line("uniform bool physics:excludeFromArticulation = true")
    if kind in ONE_AXIS:
        out.line(f'uniform token physics:axis = "{next(iter(free))[-1]}"')
    for axis in AXES if kind == GENERIC else ():
        if axis not in free:
            out.apply(f"PhysicsLimitAPI:{axis}")
            out.line(f"float limit:{axis}:physics:low = 1")
            out.line(f"float limit:{axis}:physics:high = -1")
    return out


def add_joint(
    parent: UsdPrim, joint: Joint, bodies: tuple[UsdPrim, UsdPrim], driven: bool,
    home: tuple[float, ...] | None, losses: Losses,
) -> UsdPrim | None:  # fmt: skip
    """Add a joint of the tree and return it; None for a floating joint, which USD states by having none.

    Args:
        parent: The prim that receives it.
        joint: The joint.
        bodies: The bodies of its links.
        driven: Whether it is a motor.
        home: Its position at home, None for zero.
        losses: Receives what USD cannot say.
    """
    if not WORDS[joint.kind].usd:
        losses.add(_replaced(joint.kind), joint.name)
    add_of_several(joint, losses, forces=() if joint.kind is JointKind.SPHERICAL else FORCES)
    if joint.kind is JointKind.FLOATING:
        return None
    turn = rotation_to_axis(joint.axis) if joint.kind.single else np.eye(3)
    ends = End(bodies[0], turned(joint.placement, turn)), End(bodies[1], turned(np.eye(4), turn))
    out = start_joint(parent, joint.name, free_axes(joint.kind), ends)
    if joint.kind.single:
        _add_numbers(out, joint, driven, home, losses)
    return out


def _replaced(kind: JointKind) -> str:
    """Return what becomes of joints that are no type of USD."""
    if kind is JointKind.FLOATING:
        return FREED
    return f"{kind} joints, which USD does not have: read back as hinges" if kind.hinge else in_words(kind)


def unit_of(joint: Joint) -> float:
    """Return the unit of positions of a joint in USD [m or rad]."""
    return 1.0 if joint.kind.slides else DEGREES


def _add_numbers(
    prim: UsdPrim, joint: Joint, driven: bool, home: tuple[float, ...] | None, losses: Losses
) -> None:
    """Add limits, drive, armature, friction and position of a joint with one freedom."""
    name, unit = "linear" if joint.kind.slides else "angular", unit_of(joint)
    if driven:
        prim.apply(f"PhysicsDriveAPI:{name}")
        prim.line(f'uniform token drive:{name}:physics:type = "force"')
        for word in ("stiffness", "damping"):
            prim.line(f"float drive:{name}:physics:{word} = 0")
    elif np.isfinite(joint.effort_limit):
        losses.add("effort limits of joints without a motor", joint.name)
    numbers = {"physics:lowerLimit": joint.lower / unit, "physics:upperLimit": joint.upper / unit}
    values = {
        "velocity": joint.velocity, "effort": joint.effort if driven else np.inf,
        "rotor_inertia": joint.armature, "friction": joint.friction, "damping": joint.damping,
    }  # fmt: skip
    units = {"speed": unit, "effort": 1.0, "inertia": 1.0, "effort at speed": 1.0 / unit}
    for word, value in to_state(NUMBERS, values).items():
        names = NUMBERS[word].about(name).names or {}
        attribute = next((one for one in names if one.startswith(WRITTEN)), next(iter(names)))
        numbers[attribute] = value / units[names[attribute]]
    if joint.friction:
        numbers[f"physxJointAxis:{name}:staticFrictionEffort"] = joint.friction
    if home is not None:
        numbers[f"state:{name}:physics:position"] = angle_of(home) / unit
    for attribute, number in numbers.items():
        if np.isfinite(number):
            if schema := SCHEMAS.get(attribute.partition(":")[0]):
                prim.apply(schema.format(name))
            prim.numbers("float", attribute, number)


def behind(closure: Closure) -> RotationKind | None:
    """Return the rotation that a closure locks behind a chain, None for a joint of USD."""
    return "parallel" if closure.rotation == "perpendicular" else None


def add_closure(parent: UsdPrim, closure: Closure, bodies: tuple[UsdPrim, UsdPrim], losses: Losses) -> None:
    """Add a closure, which is a joint of USD.

    Args:
        parent: The prim that receives it.
        closure: The closure.
        bodies: The bodies of its links.
        losses: Receives what USD cannot say.
    """
    words, turn = rows_of(closure, losses)
    free = [axis for row, axis in zip(ROWS, AXES, strict=True) if row not in words.split()]
    ends = End(bodies[0], turned(closure.frame_a, turn.T)), End(bodies[1], turned(closure.frame_b, turn.T))
    start_joint(parent, closure.name, free, ends, closes=True)
