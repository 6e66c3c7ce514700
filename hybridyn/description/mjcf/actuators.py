"""`<actuator>` of a compiled MJCF model: driven joints, their effort limits, inertia and damping of motors.

The effort of a motor is the effort at its joint, the gear times the force of the actuator. Servo laws are not
read.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..names import listed
from ..records import Coupling
from ..robot_file import MotorStatement, RobotFile
from .compiling import Compiled
from .fields import nonzero, number
from .tendons import fixed_terms

WHERE = "MJCF <actuator>"
MEND = "To drive other joints, name them: motors=[..], --motors, or motors = [..] in model.toml"


def add_actuators(robot: RobotFile, compiled: Compiled) -> None:
    """Add the list of motors, and what actuators add to their joints, to the robot.

    Actuators that no motor expresses are left out, and noted.

    Raises:
        ModelError: A motor's damping depends on its speed.
    """
    names: list[str] = []
    reasons: dict[str, str] = {}
    limits: dict[str, float] = {}
    extra: dict[str, tuple[float, float]] = {}
    servos: list[str] = []
    for actuator in range(count(compiled)):
        driven = driven_joint(robot, compiled, actuator)
        if isinstance(driven, str):
            reasons[compiled.name("actuator", actuator) or str(actuator)] = driven
            continue
        joint, gear = driven
        if nonzero(compiled.model, "actuator_dampingpoly", actuator):
            raise compiled.error(
                "actuator", actuator, "damping that depends on the speed is not read; keep its first number"
            )
        if joint not in names:
            names.append(joint)
        limits[joint] = limits.get(joint, 0.0) + effort_limit(compiled, actuator, gear)
        inertia, damping = extra.get(joint, (0.0, 0.0))
        extra[joint] = (
            inertia + number(compiled.model, "actuator_armature", actuator) * gear**2,
            damping + number(compiled.model, "actuator_damping", actuator) * gear**2,
        )
        if has_servo(compiled, actuator):
            servos.append(compiled.name("actuator", actuator) or joint)
    if servos:
        robot.notes.append(
            f"actuators {listed(servos)} have a servo, a muscle or dynamics of their own, which are not "
            "read: motor efforts are inputs of the models"
        )
    if reasons:
        stated = "; ".join(f"'{name}' {reason}" for name, reason in reasons.items())
        robot.notes.append(f"actuators that are no motors here: {stated}. {MEND}")
        robot.left_out = tuple(reasons)
    if names or reasons:
        robot.motors.append(MotorStatement("actuator", WHERE, tuple(names), robot.file))
    robot.joints = [
        replace(
            joint,
            effort=min(joint.effort, limits.get(joint.name, np.inf)),
            rotor_inertia=joint.rotor_inertia + extra.get(joint.name, (0.0, 0.0))[0],
            damping=joint.damping + extra.get(joint.name, (0.0, 0.0))[1],
        )
        for joint in robot.joints
    ]


def count(compiled: Compiled) -> int:
    """Return the number of actuators."""
    return len(compiled.model.actuator_trntype)


def driven_joint(robot: RobotFile, compiled: Compiled, actuator: int) -> tuple[str, float] | str:
    """Return the joint that an actuator drives and the gear between them, or why there is none.

    A tendon over joints that couplings tie to one is a gear on that joint: the power is the same.
    """
    model = compiled.model
    kind, target = int(model.actuator_trntype[actuator]), int(model.actuator_trnid[actuator][0])
    gear = float(model.actuator_gear[actuator][0])
    if kind == compiled.code("mjTRN_TENDON"):
        terms = fixed_terms(compiled, target)
        if terms is None:
            return "pulls a spatial tendon"
        followers = {coupling.terms[0][0] for coupling in robot.couplings}
        joint = next((name for name in terms if name not in followers), next(iter(terms)))
        rates = rates_along(robot.couplings, joint)
        if set(terms) <= set(rates):
            return joint, gear * sum(coefficient * rates[name] for name, coefficient in terms.items())
        return "pulls a tendon of joints that move apart"
    if kind not in (compiled.code("mjTRN_JOINT"), compiled.code("mjTRN_JOINTINPARENT")):
        return "drives no joint"
    single = (compiled.code("mjJNT_HINGE"), compiled.code("mjJNT_SLIDE"))
    if model.jnt_type[target] not in single:
        return f"drives joint '{compiled.joints[target]}', which has several freedoms"
    return compiled.joints[target], gear


def rates_along(couplings: Sequence[Coupling], joint: str) -> dict[str, float]:
    """Return the rate of each joint that couplings of two joints tie to one, where that has the rate 1."""
    rates, waiting = {joint: 1.0}, [coupling for coupling in couplings if len(coupling.terms) == 2]
    while tied := [c for c in waiting if len({name for name, _ in c.terms} & set(rates)) == 1]:
        for coupling in tied:
            (a, of_a), (b, of_b) = sorted(coupling.terms, key=lambda term: term[0] not in rates)
            rates[b] = -of_a / of_b * rates[a]
            waiting.remove(coupling)
    return rates


def effort_limit(compiled: Compiled, actuator: int, gear: float) -> float:
    """Return the largest effort of an actuator at its joint [N or N m], infinite where none is stated."""
    model = compiled.model
    force = np.inf
    if model.actuator_forcelimited[actuator]:
        force = float(np.abs(model.actuator_forcerange[actuator]).max())
    plain = (
        model.actuator_gaintype[actuator] == compiled.code("mjGAIN_FIXED")
        and model.actuator_biastype[actuator] == compiled.code("mjBIAS_NONE")
        and model.actuator_dyntype[actuator] == compiled.code("mjDYN_NONE")
    )
    if plain and model.actuator_ctrllimited[actuator]:
        gain = abs(float(model.actuator_gainprm[actuator][0]))
        force = min(force, gain * float(np.abs(model.actuator_ctrlrange[actuator]).max()))
    return abs(gear) * force if gear else 0.0


def has_servo(compiled: Compiled, actuator: int) -> bool:
    """Say whether an actuator's force is more than gain x control."""
    model = compiled.model
    return bool(
        model.actuator_gaintype[actuator] != compiled.code("mjGAIN_FIXED")
        or model.actuator_biastype[actuator] != compiled.code("mjBIAS_NONE")
        or model.actuator_dyntype[actuator] != compiled.code("mjDYN_NONE")
    )
