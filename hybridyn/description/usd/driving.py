"""What a USD joint has beside geometry: drives as motors, limits of effort and speed, armature, friction.

Efforts are those at the joint. The laws of drives (stiffness, damping, targets) are not read.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ..names import listed
from ..records import Joint
from ..robot_file import MotorStatement, RobotFile
from .joints import DEGREES, UsdJoint
from .stage import Prim

WHERE = "USD PhysicsDriveAPI"


@dataclass
class Driving:
    """The motors of a file.

    Attributes:
        motors: Names of the driven joints by path of their prim.
        problem: Why the list cannot be used, or "".
        servos: Paths of joints whose drive has a law.
    """

    motors: dict[str, list[str]] = field(default_factory=dict)
    problem: str = ""
    servos: list[str] = field(default_factory=list)


def is_driven(joint: UsdJoint) -> bool:
    """Return whether a drive with a force acts on a joint."""
    return any(
        joint.prim.any_number(f"drive:{name}:physics:maxForce", np.inf) != 0
        for name in joint.prim.instances("PhysicsDriveAPI")
    )


def with_properties(joint: UsdJoint, axis: str, record: Joint, driving: Driving) -> Joint:
    """Return the record of one axis of a joint with limits, armature, friction and motor.

    Args:
        axis: Its axis, or "ball" or "all" for a joint of several freedoms.
        driving: The motors found so far, to which its drive is added.

    Raises:
        ModelError: A number is negative, or a joint of several freedoms states friction or armature.
    """
    prim, stage = joint.prim, joint.prim.stage
    if axis in ("ball", "all", "plane", ""):
        _refuse_on_several(joint, axis, driving)
        return record
    name, angular = joint.instance(axis), axis.startswith("rot")
    effort = stage.kilograms * (stage.meters**2 if angular else stage.meters)
    speed = DEGREES if angular else stage.meters
    inertia = stage.kilograms * (stage.meters**2 if angular else 1.0)
    lower, upper = joint.limits.get(axis, (-np.inf, np.inf))
    per_axis = f"physxJointAxis:{name}"
    record = replace(
        record,
        lower=lower,
        upper=upper,
        velocity=_limit(prim, (f"{per_axis}:maxJointVelocity", "physxJoint:maxJointVelocity")) * speed,
        friction=_first(prim, (f"{per_axis}:dynamicFrictionEffort", "physxJoint:jointFriction")) * effort,
        damping=_first(prim, (f"{per_axis}:viscousFrictionCoefficient",)) * effort / speed,
        rotor_inertia=_first(prim, (f"{per_axis}:armature", "physxJoint:armature")) * inertia,
    )
    return _driven(joint, name, record, effort, driving)


def add_motors(robot: RobotFile, driving: Driving) -> None:
    """Add the list of motors to the robot, in the order of the file."""
    if driving.servos:
        robot.notes.append(
            f"drives of {listed(driving.servos)} have stiffness or damping, which are not read: motor "
            "efforts are inputs of the models"
        )
    names = tuple(dict.fromkeys(name for of_joint in driving.motors.values() for name in of_joint))
    if names or driving.problem:
        robot.motors.append(MotorStatement("actuator", WHERE, names, robot.file, None, driving.problem))


def _driven(joint: UsdJoint, name: str, record: Joint, effort: float, driving: Driving) -> Joint:
    """Return the record with the limit of its effort; add its motor."""
    prim, drive = joint.prim, f"drive:{name}:physics"
    if name not in prim.instances("PhysicsDriveAPI"):
        return replace(record, effort=_limit(prim, ("hybridyn:maxForce",)) * effort)
    force = _limit(prim, (f"{drive}:maxForce",))
    if force:
        driving.motors.setdefault(prim.path, []).append(record.name)
        if prim.number(f"{drive}:stiffness", 0.0) or prim.number(f"{drive}:damping", 0.0):
            driving.servos.append(prim.path)
    return replace(record, effort=force * effort)


def _refuse_on_several(joint: UsdJoint, axis: str, driving: Driving) -> None:
    """Refuse friction and armature of a joint of several freedoms; its drives are no motors."""
    prim = joint.prim
    for name in ("physxJoint:armature", "physxJoint:jointFriction"):
        if axis and prim.number(name, 0.0):
            raise prim.error(f"'{name}' of a joint with several freedoms is not read; set it to 0")
    if is_driven(joint) and axis:
        driving.problem = driving.problem or (
            f"<{prim.path}> is driven, but has several freedoms; name the driven joints: motors=[..], "
            "--motors, or motors = [..] in model.toml"
        )


def _first(prim: Prim, names: tuple[str, ...]) -> float:
    """Return the first authored number, 0 where there is none; it must not be negative."""
    for name in names:
        if prim.states(name):
            value = prim.number(name, 0.0)
            if value < 0:
                raise prim.error(f"'{name}' is negative")
            return value
    return 0.0


def _limit(prim: Prim, names: tuple[str, ...]) -> float:
    """Return the first authored limit, infinite where there is none."""
    for name in names:
        if prim.states(name):
            value = prim.any_number(name, np.inf)
            if value < 0:
                raise prim.error(f"'{name}' is negative")
            return value
    return float(np.inf)
