"""Programs of a robot that hold for the designs near its own."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..compiled import RobotPrograms, asked_for
from ..effects.choice import Choice, Effects
from ..errors import ModelError
from ..spatial import Index
from ..structure.building import rebuilt
from ..structure.parameters.chosen import Parameters
from ..structure.robot import HybridRobot

#: Change of a number, as a part of its size or of one, at which no comparison may have another outcome.
NEARBY = 1e-7


def programs_alike(
    robot: HybridRobot, on: Effects, parameters: Parameters, effects: Choice, wrenches: Sequence[str]
) -> RobotPrograms:
    """Return programs of the robot, of which no wrist is cut if a parameter may open it.

    Args:
        robot: The robot.
        on: Its effects.
        parameters: Its parameters.
        effects: The effects as they were asked for.
        wrenches: Links on which wrenches act.

    Raises:
        ModelError: A parameter decides the structure otherwise at its smallest change.
    """
    programs = RobotPrograms(robot, on, parameters.slots, wrenches=wrenches)
    if not len(_deciding(programs, parameters)):
        return programs
    wrists = [
        module.joints[joint]
        for module in robot.modules
        for wrist in module.mechanism.spec.wrists
        for joint in wrist.joints
    ]
    uncut, on, chosen = asked_for(
        rebuilt(robot, held=[*robot.held, *wrists]), effects, [*parameters.slots], "float64"
    )
    programs = RobotPrograms(uncut, on, chosen.slots, wrenches=wrenches)
    if len(wrong := _deciding(programs, parameters)):
        name = parameters.labels[int(wrong[0])]
        raise ModelError(
            f"parameter '{name}': its smallest change gives the robot another structure, so that there are "
            "no gradients; leave it out",
            element=name,
        )
    return programs


def _deciding(programs: RobotPrograms, parameters: Parameters) -> Index:
    """Return the numbers of which a small change decides the structure otherwise."""
    p = parameters.nominal
    steps = NEARBY * np.maximum(np.abs(p), 1.0) * np.eye(len(p))
    slots, _ = parameters.possible(np.concatenate([p + steps, p - steps]))
    either = programs.other_structure(slots).reshape(2, -1).any(axis=0)
    return np.flatnonzero(either)
