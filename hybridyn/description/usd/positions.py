"""What a USD stage says of joint positions: couplings, and the home posture.

Couplings are PhysX's and Newton's mimic joints, and MuJoCo's equalities of joints. Home is that of joint
states, else the positions that the bodies' transforms give.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...spatial import quaternion_from_rotation, rotation_from_axis_angle
from ..names import listed
from ..placement import inverse
from ..records import Array, Coupling, RobotFile
from .joints import UsdJoint, direction, instance, unit_of
from .schema import AXES, SINGLE_PRECISION
from .stage import Prim, Stage

#: Positions below this [rad, or of the robot's size] are single-precision rounding of transforms.
TRANSFORM_ROUNDING = 1e-6

#: Deviation [rad, or of the robot's size] above which bodies do not stand where their joint allows.
OFF_AXIS = 1e-3

PHYSX, NEWTON, MUJOCO = "PhysxMimicJointAPI", "NewtonMimicAPI", "MjcEqualityJointAPI"


def coupled(stage: Stage) -> set[str]:
    """Return the paths of all joints that are coupled."""
    out: set[str] = set()
    for prim in stage.prims.values():
        leaders = [f"physxMimicJoint:{axis}:referenceJoint" for axis in prim.instances(PHYSX)]
        leaders += ["newton:mimicJoint", "mjc:target"] if prim.has(NEWTON, MUJOCO) else []
        if leaders:
            out |= {prim.path, *(path for name in leaders for path in prim.targets(name))}
    return out


def couplings(stage: Stage, joints: Mapping[str, UsdJoint]) -> list[Coupling]:
    """Return the couplings of a stage.

    Args:
        stage: The stage.
        joints: The joints of the robot by path.

    Raises:
        ModelError: A coupled joint is unknown or has several freedoms, a coupling is no linear one, or those
            of two engines differ.
    """
    out: list[Coupling] = []
    for prim in stage.prims.values():
        out += [_physx(prim, axis, joints) for axis in prim.instances(PHYSX)]
        if prim.has(NEWTON, MUJOCO) and prim.flag("newton:mimicEnabled", True):
            of_newton = _newton(prim, joints)
            of_physx = next((one for one in out if one.name == of_newton.name), None)
            if of_physx is None:
                out.append(of_newton)
            elif not _same(of_physx, of_newton):
                raise prim.error("couples this joint otherwise for PhysX than for Newton; keep one coupling")
    return out


def _same(one: Coupling, other: Coupling) -> bool:
    """Return whether two couplings of a joint are one, to the single precision of files."""
    (ours, a), (theirs, b) = (zip(*of.terms, strict=True) for of in (one, other))
    numbers = [*a, one.offset], [*b, other.offset]
    return ours == theirs and np.allclose(*numbers, rtol=SINGLE_PRECISION, atol=SINGLE_PRECISION)


def _physx(prim: Prim, axis: str, joints: Mapping[str, UsdJoint]) -> Coupling:
    """Return position + gearing x position of the other + offset = 0, in the units of the file."""
    space = f"physxMimicJoint:{axis}"
    own, unit, _ = _axis(prim, prim.path, axis, joints)
    reference = prim.word(f"{space}:referenceJointAxis", "")
    other, its_unit, _ = _axis(prim, _leader(prim, f"{space}:referenceJoint"), reference, joints)
    factor = prim.number(f"{space}:gearing", 1.0) * unit / its_unit
    return Coupling(own, ((own, 1.0), (other, factor)), -prim.number(f"{space}:offset", 0.0) * unit)


def _newton(prim: Prim, joints: Mapping[str, UsdJoint]) -> Coupling:
    """Return position = coefficient 0 + coefficient 1 x position of the other.

    Newton's coefficients are in the units of the file; MuJoCo's, which rank above, know no degrees.
    """
    mujoco = prim.has(MUJOCO)
    for number in (2, 3, 4):
        if mujoco and prim.number(f"mjc:coef{number}", 0.0):
            raise prim.error(f"'mjc:coef{number}' makes the equality no linear one; set it to 0")
    own, unit, native = _axis(prim, prim.path, "", joints)
    offset = prim.number("newton:mimicCoef0", 0.0) * unit
    if mujoco and prim.value("mjc:coef0") is not None:
        offset = prim.number("mjc:coef0", 0.0) * native
    relation = "mjc:target" if mujoco and prim.targets("mjc:target") else "newton:mimicJoint"
    if mujoco and not prim.targets(relation):
        return Coupling(own, ((own, 1.0),), offset)
    other, its_unit, its_native = _axis(prim, _leader(prim, relation), "", joints)
    factor = prim.number("newton:mimicCoef1", 1.0) * unit / its_unit
    if mujoco and prim.value("mjc:coef1") is not None:
        factor = prim.number("mjc:coef1", 1.0) * native / its_native
    return Coupling(own, ((own, 1.0), (other, -factor)), offset)


def _leader(prim: Prim, relation: str) -> str:
    """Return the one path that a relationship names."""
    targets = prim.targets(relation)
    if len(targets) != 1:
        raise prim.error(f"'{relation}' names {len(targets)} joints; name one")
    return targets[0]


def _axis(prim: Prim, path: str, axis: str, joints: Mapping[str, UsdJoint]) -> tuple[str, float, float]:
    """Return the name of the record of a joint's axis, and the units of its positions and of MuJoCo's.

    PhysX's names of axes do not matter where a joint has only one.
    """
    if path not in joints:
        raise prim.error(f"couples <{path}>, which is no joint that is read")
    names = joints[path].names
    free = [own for own in names if own != "ball" and (own == axis or len(names) == 1)]
    if len(free) != 1:
        word = f"has no free axis '{axis}'" if axis else "does not have one freedom"
        raise prim.error(f"couples <{path}>, which {word}; couple joints with one freedom")
    if prim.has(MUJOCO) and joints[path].prim.number("mjc:ref", 0.0):
        raise prim.error(f"couples <{path}>, whose 'mjc:ref' shifts its zero; set it to 0")
    unit = unit_of(prim, free[0])
    return names[free[0]], unit, 1.0 if free[0].startswith("rot") else unit


def add_home(robot: RobotFile, stage: Stage, joints: list[tuple[UsdJoint, bool]]) -> None:
    """Add the home posture to the robot; positions of zero are left out.

    Args:
        robot: The robot.
        stage: Its stage.
        joints: The joints of the tree, each with whether its second body is the child.
    """
    poses = {path: prim.pose for path, prim in stage.moving.items()}
    placements = [*poses.values(), *(frame for joint, _ in joints for frame in joint.frames)]
    size = max((float(np.abs(place[:3, 3]).max()) for place in placements), default=0.0) or 1.0
    off = []
    for joint, forward in joints:
        first, second = (
            poses.get(end, np.eye(4)) @ frame for end, frame in zip(joint.ends, joint.frames, strict=True)
        )
        found = inverse(first) @ second
        positions, motion = _moved(joint, found)
        deviation = np.abs(found - motion)
        if max(deviation[:3, 3].max() / size, deviation[:3, :3].max()) > OFF_AXIS:
            off.append(joint.prim.path)
        for axis, position in positions.items():
            state, unit = f"state:{instance(joint.prim, axis)}:physics:position", unit_of(joint.prim, axis)
            zero = TRANSFORM_ROUNDING * (1.0 if axis.startswith("rot") else size)
            value = joint.prim.number(state, 0.0) * unit or (position if abs(position) > zero else 0.0)
            if value:
                robot.home[joint.names[axis]] = (value,)
        if "ball" in joint.names and (turn := _ball_coordinates(joint, forward, found)):
            robot.home[joint.names["ball"]] = turn
    if off:
        robot.notes.append(
            f"joints {listed(off)} do not allow the poses of their bodies; home is the nearest posture"
        )


def _moved(joint: UsdJoint, found: Array) -> tuple[dict[str, float], Array]:
    """Return the positions nearest to a motion of a joint, and its motion there.

    Args:
        joint: The joint.
        found: Its second frame in the first, shape (4, 4).

    Returns:
        Positions along the axes with one freedom [m or rad], and the second frame in the first, shape (4, 4).
    """
    positions, motion = {}, np.eye(4)
    for axis in joint.chain:
        i = AXES.index(axis) % 3 if axis != "ball" else 0
        j, k = (i + 1) % 3, (i + 2) % 3
        if axis == "ball":
            motion[:3, :3] = found[:3, :3]
        elif axis.startswith("trans"):
            positions[axis] = motion[i, 3] = float(found[i, 3])
        else:
            sine, cosine = found[k, j] - found[j, k], found[j, j] + found[k, k]
            positions[axis] = angle = float(np.arctan2(sine, cosine))
            motion[:3, :3] = rotation_from_axis_angle(direction(axis), np.cos(angle), np.sin(angle))
    return positions, motion


def _ball_coordinates(joint: UsdJoint, forward: bool, found: Array) -> tuple[float, ...]:
    """Return the quaternion x, y, z, w of a ball joint, empty for zero.

    The joint turns about the child's axes where its frame has the child's origin, else about its frame's.
    """
    moved, far = (found, joint.frames[1]) if forward else (inverse(found), joint.frames[0])
    ends_in_child = not far[:3, 3].any() and (forward or len(joint.chain) == 1)
    turn = far[:3, :3] if ends_in_child else np.eye(3)
    seen = turn @ moved[:3, :3] @ turn.T
    if np.abs(seen - np.eye(3)).max() <= TRANSFORM_ROUNDING:
        return ()
    return tuple(float(x) for x in quaternion_from_rotation(seen))
