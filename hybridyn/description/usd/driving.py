"""What a USD joint has beside geometry: drives as motors, limits of effort and speed, armature, friction.

Efforts are those at the joint. The laws of drives (stiffness, damping, targets) are not read.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..names import listed
from ..robot_file import MotorStatement, RobotFile
from .stage import Prim, Stage

#: Angles between the unit of a file and radians.
DEGREES = np.pi / 180

WHERE = "USD PhysicsDriveAPI"

#: What a joint states about an axis: the number in `records.Joint`, the attribute ("{}" is the axis), and the
#: unit. Where several engines have their own attribute, the first that is authored counts.
ROWS = (
    ("velocity", "physxJointAxis:{}:maxJointVelocity", "speed"),
    ("velocity", "physxJoint:maxJointVelocity", "speed"),
    ("effort", "drive:{}:physics:maxForce", "effort"),
    ("rotor_inertia", "physxJointAxis:{}:armature", "inertia"),
    ("rotor_inertia", "physxJoint:armature", "inertia"),
    ("rotor_inertia", "newton:armature", "inertia"),
    ("rotor_inertia", "mjc:armature", "inertia"),
    ("friction", "physxJointAxis:{}:dynamicFrictionEffort", "effort"),
    ("friction", "physxJoint:jointFriction", "effort"),
    ("friction", "newton:friction", "effort"),
    ("friction", "mjc:frictionloss", "effort"),
    ("damping", "physxJointAxis:{}:viscousFrictionCoefficient", "effort at speed"),
    ("damping", "mjc:damping", "effort at one radian or metre a second"),
)

#: Numbers by which a joint needs its position.
WEIGHTS = ("rotor_inertia", "friction", "damping")


@dataclass
class Motors:
    """The motors of a file.

    Attributes:
        names: Names of the driven joints.
        problem: Why the list cannot be used, or "".
        servos: Paths of joints whose drive has a law.
    """

    names: list[str] = field(default_factory=list)
    problem: str = ""
    servos: list[str] = field(default_factory=list)

    def add(self, prim: Prim, axis: str, name: str, actuated: bool) -> None:
        """Add the record of an axis if it is driven.

        Args:
            prim: The joint.
            axis: Name of the axis in schemas ("angular"), "" for a ball.
            name: Name of the record.
            actuated: Whether an actuator acts on the joint.
        """
        drive = f"drive:{axis}:physics"
        has_drive = axis in prim.instances("PhysicsDriveAPI")
        if not axis and (actuated or is_driven(prim)):
            self.problem = self.problem or (
                f"<{prim.path}> is driven, but has several freedoms; name the driven joints: motors=[..], "
                "--motors, or motors = [..] in model.toml"
            )
        elif actuated or (has_drive and prim.any_number(f"{drive}:maxForce", np.inf)):
            self.names.append(name)
        else:
            return
        if has_drive and (prim.number(f"{drive}:stiffness", 0.0) or prim.number(f"{drive}:damping", 0.0)):
            self.servos.append(prim.path)

    def state(self, robot: RobotFile) -> None:
        """Add the list of motors to the robot."""
        if self.servos:
            robot.notes.append(
                f"drives of {listed(dict.fromkeys(self.servos))} have stiffness or damping, which are not "
                "read: motor efforts are inputs of the models"
            )
        if self.names or self.problem:
            names = tuple(self.names)
            robot.motors.append(MotorStatement("actuator", WHERE, names, robot.file, None, self.problem))


def is_driven(prim: Prim) -> bool:
    """Return whether a drive with a force acts on a joint."""
    return any(
        prim.any_number(f"drive:{name}:physics:maxForce", np.inf) != 0
        for name in prim.instances("PhysicsDriveAPI")
    )


def actuated(stage: Stage) -> set[str]:
    """Return the paths of the prims on which actuators of MuJoCo act."""
    actuators = [prim for prim in stage.prims.values() if prim.kind == "MjcActuator"]
    return {path for prim in actuators for path in prim.targets.get("mjc:target", ())}


def is_heavy(prim: Prim, axes: list[str]) -> bool:
    """Return whether a joint has armature or friction about one of its axes ("angular")."""
    stated = [name.format(axis) for word, name, _ in ROWS for axis in axes if word in WEIGHTS]
    return any(prim.states(name) and prim.values[name] for name in stated)


def is_limited(prim: Prim) -> bool:
    """Return whether a joint has limits of its position."""
    limits = [prim.any_number(f"physics:{word}Limit", np.inf) for word in ("lower", "upper")]
    return bool(np.isfinite(limits).any())


def numbers_of(prim: Prim, axis: str, angular: bool) -> dict[str, float]:
    """Return speed and effort limit, armature and friction of an axis, as in `records.Joint`.

    Args:
        axis: Name of the axis in schemas ("angular").
        angular: Whether it is an axis of rotation.

    Raises:
        ModelError: A number is negative.
    """
    stage = prim.stage
    effort = stage.kilograms * (stage.meters**2 if angular else stage.meters)
    speed = DEGREES if angular else stage.meters
    units = {
        "speed": speed, "effort": effort, "inertia": stage.kilograms * (stage.meters**2 if angular else 1.0),
        "effort at speed": effort / speed,
        "effort at one radian or metre a second": effort / (1.0 if angular else stage.meters),
    }  # fmt: skip
    out: dict[str, float] = {}
    drives = prim.instances("PhysicsDriveAPI")
    for word, attribute, unit in ROWS:
        name = attribute.format(axis)
        if word in out or not prim.states(name) or (word == "effort" and axis not in drives):
            continue
        value = prim.any_number(name, np.inf) if word in ("velocity", "effort") else prim.number(name, 0.0)
        if value < 0:
            raise prim.error(f"'{name}' is negative")
        out[word] = value * units[unit]
    return out


def numbers_of_ball(prim: Prim) -> dict[str, float]:
    """Return armature and viscous friction of a ball joint, the same about each axis.

    Raises:
        ModelError: It has dry friction, or a number is negative.
    """
    numbers = numbers_of(prim, "", angular=True)
    if numbers.get("friction"):
        raise prim.error("dry friction of a joint with several freedoms is not read; set it to 0")
    return {word: numbers[word] for word in ("rotor_inertia", "damping") if word in numbers}
