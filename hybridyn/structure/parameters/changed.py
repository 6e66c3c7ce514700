"""Descriptions with other values of parameters."""

from __future__ import annotations

from collections.abc import Mapping

from numpy.typing import ArrayLike

from ...description.records import Description
from .entries import Parameters
from .slots import check_signs, with_values
from .xacro import XacroArguments


def with_numbers(description: Description, values: Mapping[str, ArrayLike]) -> Description:
    """Return a description with other values of parameters.

    Args:
        description: The robot's description.
        values: Values by name: parameters as in `entries.entry_of`, and arguments of the robot's xacro file.

    Raises:
        ModelError: A parameter is unknown, a value has a wrong size, or a mass, a stiffness or a friction is
            negative.
    """
    arguments = {name: value for name, value in values.items() if ":" not in name}
    named = {name: value for name, value in values.items() if ":" in name}
    if arguments:
        description = XacroArguments(description, tuple(arguments)).expanded(list(arguments.values()))
    parameters = Parameters(description, list(named))
    slots = parameters.slot_values(parameters.vector(named)[None])[0]
    check_signs(parameters.slots, slots)
    return with_values(description, parameters.slots, slots.tolist())
