"""Coefficients of the files' joint laws as arguments."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ....effects.choice import Effects
from ....effects.joints import OnJoints, placed
from ....errors import ModelError
from ....structure.parameters.entries import OF_EFFECTS
from ....structure.parameters.slots import Slot
from ....structure.robot import HybridRobot

#: Field of an effect that is None where its coefficients are those of the robot's files.
STATED = {"viscous_friction": "coefficient", "coulomb_friction": "level"}


def slot_of(robot: HybridRobot, law: OnJoints, i: int) -> Slot | None:
    """Return the number of the description that is the coefficient of a law's freedom i, or None."""
    field = OF_EFFECTS.get(law.effect.name)
    if field is None or getattr(law.effect, STATED[law.effect.name]) is not None:
        return None
    at = int(law.columns[i])
    joint = next(n for n, slice_ in zip(robot.joints, robot.v_slices, strict=True) if slice_.start == at)
    return Slot("joints", joint, field)


def at_robot(effects: Effects, robot: HybridRobot) -> Effects:
    """Return effects whose laws have the coefficients of another robot's files."""
    laws, rotors = (
        tuple(law for one in group if (law := placed(one.effect, robot)) is not None)
        for group in (effects.joints, effects.rotors)
    )
    return replace(effects, joints=laws, rotors=rotors)


def check_coefficients(robot: HybridRobot, effects: Effects, slots: tuple[Slot, ...]) -> None:
    """Check that a law uses each coefficient that is an argument.

    Raises:
        ModelError: The effect is off, or the coefficient is zero in the robot's files.
    """
    used = {slot_of(robot, law, i) for law in effects.joints for i in np.arange(len(law.columns)).tolist()}
    names = {field: name for name, field in OF_EFFECTS.items()}
    for slot in slots:
        if slot.field in names and slot not in used:
            name = names[slot.field]
            raise ModelError(
                f"parameter '{name}:{slot.name}': the effect '{name}' does not act on the joint with a "
                "number of the robot's files; name it in effects=, or state a coefficient that is not zero",
                element=slot.name,
            )
