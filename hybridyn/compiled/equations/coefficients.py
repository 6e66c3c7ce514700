"""Coefficients of the files' joint laws as arguments."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from ...description.records import LOAD_FRICTION, Description, StatedSpring
from ...effects.choice import Effects
from ...effects.gears import OnGears, on_gears
from ...effects.joints import JointEffect, OnJoints, placed
from ...effects.load_friction import OnLoads, coefficients, on_loads
from ...effects.springs import Spring
from ...effects.tendons import OnTendons
from ...errors import ModelError
from ...structure.parameters.entries import OF_EFFECTS
from ...structure.parameters.slots import Slot
from ...structure.robot import HybridRobot


def slots_of(robot: HybridRobot, law: OnJoints | OnTendons, i: int) -> list[Slot | None]:
    """Return for each coefficient of a law's freedom i the number of the description that it is, or None."""
    none: list[Slot | None] = [None] * len(law.p)
    if isinstance(law, OnTendons):
        return none
    if type(law.effect) is Spring:
        joint = _joint_of(robot, law, i)
        return [Slot("springs", joint, "stiffness"), Slot("springs", joint, "rest"), *none[2:]]
    field = OF_EFFECTS.get(law.effect.name)
    if field is None or getattr(law.effect, law.effect.by_joint[0]) is not None:
        return none
    return [Slot("joints", _joint_of(robot, law, i), field), *none[1:]]


def friction_slots(law: OnLoads | None) -> list[Slot]:
    """Return the number of the description that each term's coefficient of load friction is."""
    if law is None:
        return []
    terms = zip(law.of_joint, law.words, strict=True)
    return [Slot("load_friction", law.joints[joint], word) for joint, word in terms]


def gear_slots(gears: OnGears | None, motor: str) -> list[Slot]:
    """Return the numbers of the description that the efficiency of a motor's gear is, and back if stated."""
    if gears is None or motor not in gears.effect.efficiency:
        return []
    fields = ("efficiency",) if gears.effect.back is None else ("efficiency", "back")
    return [Slot("gears", motor, field) for field in fields]


def _joint_of(robot: HybridRobot, law: OnJoints, i: int) -> str:
    """Return the joint of a law's freedom i."""
    at = int(law.columns[i])
    return next(n for n, own in zip(robot.joints, robot.v_slices, strict=True) if own.start <= at < own.stop)


def with_stated_effects(robot: HybridRobot, effects: Effects) -> HybridRobot:
    """Return a robot whose description states springs and losses of its models, which are its parameters.

    Raises:
        ModelError: Several springs act on a joint.
    """
    description = _with_losses(robot.description, effects)
    if description is not robot.description:
        robot = replace(robot, description=description)
    springs = [
        StatedSpring(joint, *values[:2])
        for law in effects.joints
        if type(law.effect) is Spring
        for joint, values in law.effect.numbers(robot).items()
    ]
    if not springs or tuple(springs) == robot.description.springs:
        return robot
    names = [spring.name for spring in springs]
    for name in names:
        if names.count(name) > 1:
            raise ModelError(
                f"several springs act on joint '{name}': a model with parameters takes one", element=name
            )
    return replace(robot, description=robot.description.with_springs(springs))


def _with_losses(description: Description, effects: Effects) -> Description:
    """Return a description that states the load friction and the gears of some effects."""
    if effects.loaded is not None:
        law = effects.loaded.effect
        numbers: dict[str, Any] = {
            word: {joint: float(x) for joint, x in table.items()}
            for word, table in {**coefficients(law), "static": law.static, "speed": law.speed}.items()
        }
        description = description.with_effect("load_friction", numbers | {"width": law.width})
    if effects.gears is not None:
        gear = effects.gears.effect
        numbers = {
            "efficiency": {motor: float(x) for motor, x in gear.efficiency.items()},
            "width": gear.width,
        }
        if gear.back is not None:
            numbers["back"] = {
                motor: float(gear.back.get(motor, 2 - 1 / x)) for motor, x in gear.efficiency.items()
            }
        description = description.with_effect("gear_efficiency", numbers)
    return description


def at_robot(effects: Effects, robot: HybridRobot) -> Effects:
    """Return effects whose laws have the coefficients of another robot's description."""

    def stated(group: Sequence[Any]) -> tuple[Any, ...]:
        """Return laws with the coefficients of the description; those of tendons stay."""
        laws = (
            one if isinstance(one, OnTendons) else placed(_stated(one.effect, robot), robot) for one in group
        )
        return tuple(law for law in laws if law is not None)

    loaded = effects.loaded
    if loaded is not None and (own := robot.description.load_friction):
        tables: dict[str, Any] = {  # zeros stay where the law has numbers: a static part needs them
            word: dict.fromkeys(table, 0.0) | {x.name: getattr(x, word) for x in own if getattr(x, word)}
            for word, table in coefficients(loaded.effect).items()
        }
        loaded = on_loads(replace(loaded.effect, **tables), robot)
    gears = effects.gears
    if gears is not None and (lossy := robot.description.gears):
        back = None if gears.effect.back is None else {x.name: x.back for x in lossy}
        law = replace(gears.effect, efficiency={x.name: x.efficiency for x in lossy}, back=back)
        gears = on_gears(law, robot)
    return replace(
        effects,
        loaded=loaded,
        gears=gears,
        joints=stated(effects.joints),
        rotors=stated(effects.rotors),
        links=tuple(law.bound(robot) for law in effects.links),
    )


def _stated(effect: JointEffect, robot: HybridRobot) -> JointEffect:
    """Return an effect with the coefficients that a robot's description states for its joints."""
    if type(effect) is not Spring:
        return effect
    known = {spring.name: spring for spring in robot.description.springs if spring.name in effect.stiffness}
    return Spring(
        {**effect.stiffness, **{name: spring.stiffness for name, spring in known.items()}},
        {**effect.rest, **{name: spring.rest for name, spring in known.items()}},
    )


def check_coefficients(robot: HybridRobot, effects: Effects, slots: tuple[Slot, ...]) -> None:
    """Check that a law uses each coefficient that is an argument.

    Raises:
        ModelError: The effect is off, or the coefficient is zero in the robot's files.
    """
    used = {
        slot for law in effects.joints for i in range(len(law.columns)) for slot in slots_of(robot, law, i)
    }
    used.update(friction_slots(effects.loaded))
    used.update(slot for motor in robot.motors for slot in gear_slots(effects.gears, motor))
    names = {field: name for name, field in OF_EFFECTS.items()}
    names |= {word: f"load_friction_{word}" for word in LOAD_FRICTION}
    names |= {"stiffness": "spring_stiffness", "rest": "spring_rest"}
    names |= {"efficiency": "gear_efficiency", "back": "gear_back"}
    for slot in slots:
        if slot.field in names and slot not in used:
            name = names[slot.field]
            raise ModelError(
                f"parameter '{name}:{slot.name}': '{name}' does not act on the joint with a number of the "
                "robot's files; name the effect in effects=, or state a coefficient that is not zero",
                element=slot.name,
            )
