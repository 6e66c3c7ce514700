"""Numbers of a description that a study states by expressions or scales."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product

import numpy as np

from ...description.records import Description
from ...errors import ModelError
from ...scenes.toml_source import naming
from ...spatial import Array
from ...structure.parameters.chosen import Parameters
from ...structure.parameters.entries import Entry, entry_of
from ...structure.parameters.slots import Slot, values_of, with_values, wrong_numbers
from .expressions import Expression
from .study_file import StudyFile

#: Labels of numbers of which a parameter has several.
LABELS = ("x", "y", "z", "roll", "pitch", "yaw", "xx", "xy", "xz", "yy", "yz", "zz")


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
        self.source, self.expressions = source, dict[str, Expression]()
        for name, text in source.study.numbers.items():
            with naming(source, ("numbers", name)):
                self.expressions[name] = Expression(text, list(source.study.parameters), "its expression")
        self.parameters = {name for one in self.expressions.values() for name in one.used}

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
        found = {}
        for name in self.expressions:
            with naming(self.source, ("numbers", name)):
                found[name] = _number(description, name)
        with naming(self.source, ("numbers",)):
            known = Parameters(description, list(dict.fromkeys(entry.name for entry, _ in found.values())))
        designs = len(next(iter(values.values())))
        rows = np.tile(known.nominal, (designs, 1))
        for name, expression in self.expressions.items():
            rows[:, known.labels.index(found[name][1])] = expression(values)
        numbers = self._scaled(description, values)
        stated = dict(zip(known.slots, known.slot_values(rows).T, strict=True))
        numbers |= {slot: stated[slot] for entry, label in found.values() for slot in _set_by(entry, label)}
        return tuple(numbers), np.array([*numbers.values()]).reshape(-1, designs).T

    def _scaled(self, description: Description, values: Mapping[str, Array]) -> dict[Slot, Array]:
        """Return masses and inertias of links that parameters scale, shape (designs,) each."""
        out: dict[Slot, Array] = {}
        for name, one in self.source.study.parameters.items():
            for kind, link in product(("mass", "inertia"), one.links):
                with naming(self.source, ("parameters", name, "scale_inertia")):
                    slots = entry_of(description, f"{kind}:{link}").slots
                for slot, number in zip(slots, values_of(description, slots), strict=True):
                    out[slot] = out.get(slot, number) * values[name]
        return out

    def described(self, description: Description, values: Mapping[str, float]) -> Description:
        """Return a description with the numbers of a design.

        Raises:
            ModelError: A name is unknown, or a number is not finite or out of the range that files may state.
        """
        if not self.expressions and not any(one.links for one in self.source.study.parameters.values()):
            return description
        slots, rows = self.in_slots(description, {name: np.array([value]) for name, value in values.items()})
        wrong = {slot for slot, *_ in wrong_numbers(slots, rows, description)}
        for slot, own in zip(slots, rows.T, strict=True):
            if slot in wrong or not np.isfinite(own).all():
                where = "numbers" if self.expressions else "parameters"
                raise self.source.error((where,), f"{slot} cannot be {own[0]:g}")
        return with_values(description, slots, rows[0].tolist())


def _number(description: Description, name: str) -> tuple[Entry, str]:
    """Return the parameter to which a number belongs, and the number's label in it."""
    whole, _, label = name.rpartition(".")
    try:
        found = entry_of(description, name)
    except ModelError:
        if label not in LABELS:
            raise
        found = entry_of(description, whole)
        if name in found.labels:
            return found, name
        raise
    if found.size > 1:
        raise ModelError(
            f"'{name}' has {found.size} numbers: name one, such as '{found.labels[0]}'", element=name
        )
    return found, found.labels[0]


def _set_by(entry: Entry, label: str) -> tuple[Slot, ...]:
    """Return the slots that a number sets: its own, or all of a frame, whose rotation angles set together."""
    return (entry.slots[entry.labels.index(label)],) if entry.size == len(entry.slots) else entry.slots
