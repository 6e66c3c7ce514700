"""`<actuator>` of a compiled MJCF model: driven joints, their effort limits, inertia and damping of motors.

The effort of a motor is the effort at its joint, the gear times the force of the actuator. Servo laws are not
read.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..names import listed
from ..records import Array, Coupling
from ..robot_file import MotorStatement, RobotFile
from .compiling import Compiled
from .equalities import fixed_terms

WHERE = "MJCF <actuator>"
MEND = "To drive other joints, name them: motors=[..], --motors, or motors = [..] in model.toml"


def add_actuators(robot: RobotFile, compiled: Compiled) -> None:
    """Add the list of motors, and what actuators add to their joints, to the robot.

    Actuators that no motor expresses are left out, and noted.

    Raises:
        ModelError: A motor's damping depends on its speed.
    """
    reasons: dict[str, str] = {}
    added: dict[str, Array] = {}  # by joint: limit of its effort, inertia, damping
    servos: list[str] = []
    for actuator in range(len(compiled.model.actuator_trntype)):
        name = compiled.name("actuator", actuator)
        driven = _driven_joint(robot.couplings, compiled, actuator)
        if isinstance(driven, str):
            reasons[name or str(actuator)] = driven
            continue
        joint, gear = driven
        own, plain = _numbers(compiled, actuator, gear)
        added[joint] = added.get(joint, np.zeros(3)) + own
        if not plain:
            servos.append(name or joint)
    if servos:
        robot.notes.append(
            f"actuators {listed(servos)} have a servo, a muscle or dynamics of their own, which are not "
            "read: motor efforts are inputs of the models"
        )
    if reasons:
        stated = "; ".join(f"'{name}' {reason}" for name, reason in reasons.items())
        robot.notes.append(f"actuators that are no motors here: {stated}. {MEND}")
        robot.left_out = tuple(reasons)
    if added or reasons:
        robot.motors.append(MotorStatement("actuator", WHERE, tuple(added), robot.file))
    for i, old in enumerate(robot.joints):
        if old.name in added:
            limit, inertia, damping = (float(number) for number in added[old.name])
            robot.joints[i] = replace(
                old,
                effort=min(old.effort, limit),
                rotor_inertia=old.rotor_inertia + inertia,
                damping=old.damping + damping,
            )


def _driven_joint(
    couplings: Sequence[Coupling], compiled: Compiled, actuator: int
) -> tuple[str, float] | str:
    """Return the joint that an actuator drives and the gear between them, or why there is none.

    A tendon over joints that couplings tie to one is a gear on that joint: the power is the same.
    """
    model = compiled.model
    kind, target = int(model.actuator_trntype[actuator]), int(model.actuator_trnid[actuator][0])
    if kind == compiled.code("mjTRN_TENDON"):
        terms = fixed_terms(compiled, target)
        if terms is None:
            return "pulls a spatial tendon"
    elif kind not in (compiled.code("mjTRN_JOINT"), compiled.code("mjTRN_JOINTINPARENT")):
        return "drives no joint"
    elif model.jnt_type[target] not in (compiled.code("mjJNT_HINGE"), compiled.code("mjJNT_SLIDE")):
        return f"drives joint '{compiled.joints[target]}', which has several freedoms"
    else:
        terms = {compiled.joints[target]: 1.0}
    followers = {coupling.terms[0][0] for coupling in couplings}
    joint = next((name for name in terms if name not in followers), next(iter(terms)))
    rates = _rates_along(couplings, joint)
    if not set(terms) <= set(rates):
        return "pulls a tendon of joints that move apart"
    gear = float(model.actuator_gear[actuator][0])
    return joint, gear * sum(coefficient * rates[name] for name, coefficient in terms.items())


def _rates_along(couplings: Sequence[Coupling], joint: str) -> dict[str, float]:
    """Return the rate of each joint that couplings of two joints tie to one, where that has the rate 1."""
    rates, waiting = {joint: 1.0}, [coupling for coupling in couplings if len(coupling.terms) == 2]
    while tied := [c for c in waiting if len({name for name, _ in c.terms} & set(rates)) == 1]:
        for coupling in tied:
            (a, of_a), (b, of_b) = sorted(coupling.terms, key=lambda term: term[0] not in rates)
            rates[b] = -of_a / of_b * rates[a]
            waiting.remove(coupling)
    return rates


def _numbers(compiled: Compiled, actuator: int, gear: float) -> tuple[Array, bool]:
    """Return what an actuator adds to its joint, and whether its force is no more than gain x control.

    Returns:
        The largest effort [N or N m], infinite where none is stated, inertia and damping, shape (3,).
    """
    model, force = compiled.model, np.inf
    if np.any(getattr(model, "actuator_dampingpoly", np.zeros(actuator + 1))[actuator]):
        message = "damping that depends on the speed is not read; keep its first number"
        raise compiled.error("actuator", actuator, message)
    kinds = (model.actuator_gaintype, model.actuator_biastype, model.actuator_dyntype)
    plain = not any(kind[actuator] for kind in kinds)  # fixed gain, no bias, no dynamics
    if model.actuator_forcelimited[actuator]:
        force = float(np.abs(model.actuator_forcerange[actuator]).max())
    if plain and model.actuator_ctrllimited[actuator]:
        gain = abs(float(model.actuator_gainprm[actuator][0]))
        force = min(force, gain * float(np.abs(model.actuator_ctrlrange[actuator]).max()))
    fields = ("actuator_armature", "actuator_damping")  # some versions of MuJoCo have neither
    stated = [getattr(model, field, np.zeros(actuator + 1))[actuator] * gear**2 for field in fields]
    return np.array([abs(gear) * force if gear else 0.0, *stated]), plain
