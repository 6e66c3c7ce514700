"""Numbers of a robot's description that a study sets by expressions of its parameters.

[numbers]
"position:m1_left_elbow.z" = "-upper_length"
"mass:m1_left_upper" = "density * upper_length"
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...description.records import Description
from ...errors import ModelError
from ...spatial import Array
from ...structure.parameters.entries import Entry, Parameters, entry_of
from ...structure.parameters.slots import Slot, with_values
from .expressions import Expression
from .study_file import StudyFile


class Numbers:
    """The expressions of a study for numbers of a description.

    Attributes:
        expressions: Expression of each number, by its name: a parameter of `hybridyn.compile` that is one
            number, or `PARAMETER.LABEL`.
        parameters: Names of the study's parameters that stand in them.
    """

    def __init__(self, source: StudyFile) -> None:
        """Parse the expressions.

        Raises:
            HybridynError: One is no expression of parameters.
        """
        study = source.study
        self.expressions = {
            name: Expression(text, list(study.parameters), f"{source.file}: [numbers] '{name}'")
            for name, text in study.numbers.items()
        }
        self.parameters = {name for one in self.expressions.values() for name in one.names}

    def in_slots(
        self, description: Description, values: Mapping[str, Array]
    ) -> tuple[tuple[Slot, ...], Array]:
        """Compute the numbers for designs.

        Args:
            description: The robot's description, with the numbers that no expression sets.
            values: Values of the study's parameters by name, shape (designs,) each.

        Returns:
            The slots, and the numbers in them, shape (designs, slots).

        Raises:
            ModelError: A name is unknown.
        """
        entries = {name: _entry(description, name) for name in self.expressions}
        known = Parameters(description, list(dict.fromkeys(entry.name for entry in entries.values())))
        designs = len(next(iter(values.values())))
        rows = np.tile(known.nominal, (designs, 1))
        for name, expression in self.expressions.items():
            label = name if name in known.labels else entries[name].labels[0]
            rows[:, known.labels.index(label)] = expression(values)
        return known.slots, known.slot_values(rows)

    def described(self, description: Description, values: Mapping[str, float]) -> Description:
        """Return a description with the numbers of a design.

        Raises:
            ModelError: A name is unknown, a number is not finite, or a mass is negative.
        """
        if not self.expressions:
            return description
        slots, rows = self.in_slots(description, {name: np.array([value]) for name, value in values.items()})
        for slot, number in zip(slots, rows[0], strict=True):
            if not np.isfinite(number) or (slot.field == "mass" and number < 0):
                raise ModelError(f"[numbers]: {slot} cannot be {number:g}", element=slot.name)
        return with_values(description, slots, rows[0].tolist())


def _entry(description: Description, name: str) -> Entry:
    """Return the parameter to which a number belongs."""
    whole, _, label = name.rpartition(".")
    if label in ("x", "y", "z", "roll", "pitch", "yaw", "xx", "xy", "xz", "yy", "yz", "zz"):
        found = entry_of(description, whole)
        if name in found.labels:
            return found
    found = entry_of(description, name)
    if found.size > 1:
        named = f"'{name}' has {found.size} numbers: name one, such as '{found.labels[0]}'"
        raise ModelError(f"[numbers]: {named}", element=name)
    return found
