"""Slots: single numbers of a description, which can be read and replaced."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...description.records import Description

#: Tuples of a description whose records have slots.
TABLES = ("links", "joints", "closures", "couplings")


@dataclass(frozen=True, order=True)
class Slot:
    """One number of a description.

    Attributes:
        table: One of `TABLES`.
        name: Name of the record.
        field: Name of its field.
        index: Indices of the entry in the field; empty for a plain number. A symmetric matrix has slots in
            its upper triangle.
    """

    table: str
    name: str
    field: str
    index: tuple[int, ...] = ()

    def __str__(self) -> str:
        """Describe the slot in messages."""
        at = "".join(f"[{i}]" for i in self.index)
        return f"{self.field}{at} of '{self.name}'"


def values_of(description: Description, slots: Sequence[Slot]) -> list[float]:
    """Return the numbers in slots."""
    records = {table: {one.name: one for one in getattr(description, table)} for table in TABLES}
    return [float(_entry(getattr(records[s.table][s.name], s.field), s.index)) for s in slots]


def with_values(description: Description, slots: Sequence[Slot], values: Iterable[Any]) -> Description:
    """Return a description with other numbers in slots.

    Args:
        description: The description.
        slots: The slots.
        values: Their numbers, floats or others with the operators of arithmetic.
    """
    changes: dict[str, dict[str, dict[str, Any]]] = {table: {} for table in TABLES}
    records = {table: {one.name: one for one in getattr(description, table)} for table in TABLES}
    for slot, value in zip(slots, values, strict=True):
        fields = changes[slot.table].setdefault(slot.name, {})
        if not slot.index:
            fields[slot.field] = value
            continue
        array = fields.get(slot.field)
        if array is None:
            array = np.array(getattr(records[slot.table][slot.name], slot.field))
        if not isinstance(value, (float, np.floating)) and array.dtype != object:
            array = array.astype(object)
        array[slot.index] = value
        if slot.field == "inertia":
            array[slot.index[::-1]] = value
        fields[slot.field] = array
    tables: dict[str, Any] = {
        table: tuple(
            replace(one, **changes[table][one.name]) if one.name in changes[table] else one
            for one in getattr(description, table)
        )
        for table in TABLES
        if changes[table]
    }
    return replace(description, **tables)


def _entry(field: Any, index: tuple[int, ...]) -> Any:
    """Return an entry of a field."""
    return field[index] if index else field
