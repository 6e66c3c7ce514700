"""The parameters of a model, chosen by name, and the numbers of a description that they set."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ...description.records import Description
from ...errors import ModelError
from ...spatial import Array, slices
from .entries import Entry, Numbers, entry_for, entry_of
from .slots import Slot, check_numbers, check_one, values_of
from .xacro import XacroArguments


def of_xacro(arguments: XacroArguments) -> Entry:
    """Return the parameter whose numbers are arguments of a xacro file."""
    name = ", ".join(arguments.names)
    return Entry(name, arguments.names, arguments.slots, arguments.numbers, arguments.own)


def _check_owners(entries: Sequence[Entry]) -> None:
    """Raise if two parameters set the same number, or a link's numbers and those of its payload."""
    owner: dict[Slot, str] = {}
    for entry in entries:
        for slot in entry.slots:
            if slot in owner:
                raise ModelError(
                    f"parameters '{owner[slot]}' and '{entry.name}' both set {slot}", element=entry.name
                )
            owner[slot] = entry.name
    both = {slot.name for slot in owner if slot.table == "loads"}
    for slot, name in owner.items():
        if slot.table == "links" and slot.name in both:
            raise ModelError(
                f"parameter '{name}': link '{slot.name}' has parameters of its payload, which are part "
                "of its numbers: name one of both",
                element=slot.name,
            )


class Parameters:
    """The parameters of a model, in order.

    Attributes:
        names: What was asked for, in order.
        entries: The parameters.
        labels: Name of each number.
        slots: The slots that they set, each once.
        arguments: Those of the robot's xacro file, or None.
        nominal: The numbers in the robot's description, shape (size,).
    """

    def __init__(self, description: Description, names: Sequence[str | Slot]) -> None:
        """Find the parameters in a description.

        Args:
            description: The robot's description.
            names: Names as `entry_of` takes them, slots, and arguments of the robot's xacro file. These stand
                together, where the first of them is named.

        Raises:
            ModelError: A name is unknown, or two parameters set the same number.
        """
        self.names = tuple(names)
        arguments = [name for name in names if isinstance(name, str) and ":" not in name]
        xacro = [XacroArguments(description, arguments)] if arguments else []
        self.arguments = next(iter(xacro), None)
        self.entries = tuple(
            entry_for(str(name), ("value",), [name]) if isinstance(name, Slot)
            else entry_of(description, name) if ":" in name
            else of_xacro(xacro[0])
            for name in names
            if name not in arguments[1:]
        )  # fmt: skip
        self._description = description
        self.labels = tuple(label for entry in self.entries for label in entry.labels)
        self._at = slices(entry.size for entry in self.entries)
        self.slots = tuple(slot for entry in self.entries for slot in entry.slots)
        _check_owners(self.entries)
        held = iter(values_of(description, self.slots))
        parts = [entry.own(np.array([next(held) for _ in entry.slots])) for entry in self.entries]
        self.nominal: Array = np.concatenate([np.zeros(0), *parts])

    @property
    def size(self) -> int:
        """Number of numbers."""
        return len(self.labels)

    def near(self, factor: float) -> Array:
        """Return the numbers of another design, shape (size,): all but those of rotation matrices, scaled."""
        fixed = [entry.of_matrix for entry in self.entries for _ in entry.labels]
        return np.where(np.array(fixed, dtype=bool), 1.0, factor) * self.nominal

    def beside(self, part: float, place: int) -> Array:
        """Return the numbers of a design, shape (size,), in which one coordinate of each position moves.

        Args:
            part: How far, as a part of the largest coordinate.
            place: Which one: 0 for the least, 1 for the one after it.
        """
        out = self.nominal.copy()
        for entry, at in zip(self.entries, self._at, strict=True):
            if entry.origin:
                own = out[at][:3]  # a view
                own[np.argsort(np.abs(own), kind="stable")[place]] += part * np.abs(own).max()
        return out

    def slot_values(self, p: Array) -> Array:
        """Compute the numbers in the slots, shape (T, slots), from parameters, shape (T, size).

        Raises:
            ModelError: A design is not possible.
        """
        values, errors = self.possible(p)
        if errors:
            raise errors[min(errors)]
        return values

    def check(self, numbers: Array) -> None:
        """Check that numbers in the slots are what files may state, shape (slots,) or (designs, slots).

        Raises:
            ModelError: They are not.
        """
        check_numbers(self.slots, numbers, self._description)

    def possible(self, p: Array) -> Numbers:
        """Compute `slot_values` with NaN for designs that are not possible, and these designs' errors."""
        parts, errors = [np.zeros((len(p), 0))], dict[int, ModelError]()
        for entry, at in zip(self.entries, self._at, strict=True):
            values, wrong = entry.numbers(p[:, at])
            parts.append(values)
            errors |= wrong
        return np.concatenate(parts, axis=1), errors

    def vector(self, values: Mapping[str, Any]) -> Array:
        """Return the numbers of all parameters, shape (size,), those left out as in the description.

        Raises:
            ModelError: A name is unknown, or a value has a wrong size.
        """
        out, names = self.nominal.copy(), [entry.name for entry in self.entries]
        for name, given in values.items():
            check_one(name, name, names, "parameter")
            at = self._at[names.index(name)]
            own = np.asarray(given, dtype=float).ravel()
            if own.shape != out[at].shape or not np.isfinite(own).all():
                raise ModelError(
                    f"parameter '{name}' has {len(out[at])} finite numbers, not {given!r}", element=name
                )
            out[at] = own
        return out
