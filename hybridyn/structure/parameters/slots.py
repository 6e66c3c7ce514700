"""Slots: single numbers of a description, which can be read and replaced."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from ...description.names import did_you_mean
from ...description.records import LOAD_FRICTION, Description
from ...description.residual_frames import joints_of_frames
from ...errors import ModelError
from ...spatial import Array
from ..bodies import loaded

#: Fields with slots, by the tuple of a description.
NUMBERS = {
    "links": ("mass", "com", "inertia"),
    "joints": ("placement", "damping", "friction"),
    "closures": ("frame_a", "frame_b"),
    "couplings": ("offset",),
    "springs": ("stiffness", "rest"),
    "load_friction": LOAD_FRICTION,
    "gears": ("efficiency", "back"),
    "loads": ("mass", "com", "inertia"),
}
#: Tuples of a description whose records have slots.
TABLES = tuple(NUMBERS)
#: Fields on which no equation depends, but for ratios of effort limits (`check_shares`).
WITHOUT_EFFECT = ("lower", "upper", "velocity", "effort", "line", "turn")


@dataclass(frozen=True, order=True)
class Slot:
    """One number of a description.

    Attributes:
        table: One of `TABLES`.
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
        payload = "payload's " if self.table == "loads" else ""
        return f"{payload}{self.field}{at} of '{self.name}'"


def values_of(description: Description, slots: Sequence[Slot]) -> list[float]:
    """Return the numbers in slots."""
    records = {table: {one.name: one for one in getattr(description, table)} for table in TABLES}
    return [float(np.asarray(getattr(records[s.table][s.name], s.field))[s.index]) for s in slots]


def with_values(description: Description, slots: Sequence[Slot], values: Iterable[Any]) -> Description:
    """Return a description with other numbers in slots.

    Args:
        values: Their numbers, floats or others with the operators of arithmetic.

    Raises:
        ModelError: A slot moves a frame of a closure, whose text holds the placements of its joints.
    """
    _check_frames(description, slots)
    records = {(table, one.name): one for table in TABLES for one in getattr(description, table)}
    changes: dict[tuple[str, str], dict[str, Any]] = {}
    for slot, value in zip(slots, values, strict=True):
        fields = changes.setdefault((slot.table, slot.name), {})
        before = fields.get(slot.field, getattr(records[slot.table, slot.name], slot.field))
        fields[slot.field] = _with_entry(before, slot, value) if slot.index else value
    tables: dict[str, Any] = {
        table: tuple(
            replace(one, **changes[table, one.name]) if (table, one.name) in changes else one
            for one in getattr(description, table)
        )
        for table in {table for table, _ in changes}
    }
    if "springs" in tables:
        description = description.with_springs(tables.pop("springs"))
    if "load_friction" in tables:
        description = description.with_load_friction(tables.pop("load_friction"))
    if "gears" in tables:
        description = description.with_gears(tables.pop("gears"))
    if "loads" in tables:
        of = {load.name: load for load in tables["loads"] if ("loads", load.name) in changes}
        links = tables.get("links", description.links)
        tables["links"] = tuple(loaded(link, of[link.name]) if link.name in of else link for link in links)
    return replace(description, **tables)


def _check_frames(description: Description, slots: Sequence[Slot]) -> None:
    placed = {slot.name: slot for slot in slots if slot.field == "placement"}
    for coupling in description.couplings:
        for name in joints_of_frames(description.joints, coupling.frames):
            if name in placed:
                raise ModelError(
                    f"{placed[name]} moves a frame of closure '{coupling.name}', which is written for the "
                    "numbers of the robot's file; change the file, or an argument of its xacro",
                    element=name,
                )


def _with_entry(before: Any, slot: Slot, value: Any) -> Any:
    """Return a copy of an array with another entry; a symmetric one stays so."""
    numeric = isinstance(value, float | np.floating) and before.dtype != object
    array = np.array(before, dtype=float if numeric else object)
    array[slot.index] = value
    if slot.field == "inertia":
        array[slot.index[::-1]] = value
    return array


def differences(one: Description, other: Description) -> list[Slot]:
    """Return the slots in which two descriptions differ.

    Limits, home, lines and notes may differ: the equations do not depend on them, but where motors share a
    load by their effort limits, which `check_shares` compares. What losses of gears follow from an efficiency
    is no number of its own.

    Raises:
        ModelError: They differ in more than numbers that have slots.
    """
    out = []
    for table in TABLES:
        ours, theirs = getattr(one, table), getattr(other, table)
        if [x.name for x in ours] != [x.name for x in theirs]:
            raise ModelError(f"the {table} are others: the robot has another structure")
        for x, y in zip(ours, theirs, strict=True):
            out += _differing(table, x, y)
    if not any("back" in values for name, values in one.effects if name == "gear_efficiency"):
        out = [slot for slot in out if (slot.table, slot.field) != ("gears", "back")]
    for field in ("motors", "effects", "base", "gravity"):
        mine, others = getattr(one, field), getattr(other, field)
        if field == "effects":
            mine, others = (_without_slots(effects) for effects in (mine, others))
        if mine != others:
            raise ModelError(f"the {field} are others: the robot has another structure")
    return out


def _without_slots(effects: Sequence[tuple[str, dict[str, Any]]]) -> list[tuple[str, dict[str, Any]]]:
    """Return effects without the numbers that have slots; whether gears state "back" is no number."""
    known = {"load_friction": LOAD_FRICTION, "gear_efficiency": NUMBERS["gears"]}
    stated = {"gear_efficiency": {"back": None}}
    return [
        (
            name,
            {word: x for word, x in values.items() if word not in known.get(name, ())}
            | {word: x for word, x in stated.get(name, {}).items() if word in values},
        )
        for name, values in effects
        if name != "spring"
    ]


def _differing(table: str, x: Any, y: Any) -> list[Slot]:
    """Return the slots in which two records differ."""
    out = []
    for field in fields(x):
        a, b = getattr(x, field.name), getattr(y, field.name)
        if field.name in WITHOUT_EFFECT or (np.array_equal(a, b) if isinstance(a, np.ndarray) else a == b):
            continue
        if field.name not in NUMBERS[table]:
            raise ModelError(
                f"{field.name} of '{x.name}' differs, which is no number of the models: the robot has "
                "another structure or other effects",
                element=x.name,
            )
        places = [tuple(int(i) for i in at) for at in np.argwhere(np.asarray(a) != np.asarray(b))]
        if field.name == "inertia":
            places = sorted({(min(at), max(at)) for at in places})
        out += [Slot(table, x.name, field.name, at) for at in places]
    return out


#: Fields whose numbers must not be negative, in parameters as in files.
NOT_NEGATIVE = ("mass", "stiffness", "damping", "friction", *LOAD_FRICTION)


def check_one(name: str, of: str, names: Sequence[str], what: str) -> None:
    """Check that there is exactly one record of a name."""
    if of not in names:
        hint = did_you_mean(of, names)
        raise ModelError(f"parameter '{name}': there is no {what} '{of}'{hint}", element=of)
    if names.count(of) > 1:
        raise ModelError(
            f"parameter '{name}': there are {names.count(of)} of {what} '{of}': state one instead", element=of
        )


def check_load(name: str, description: Description, of: str) -> None:
    """Check that a link has the numbers of its own and of its payload."""
    link = next(link for link in description.links if link.name == of)
    own = loaded(link, next(load for load in description.loads if load.name == of))
    if not all(np.array_equal(getattr(link, field), getattr(own, field)) for field in NUMBERS["links"]):
        raise ModelError(
            f"parameter '{name}': the numbers of link '{of}' were changed after its payload was added: add "
            "the payload last",
            element=of,
        )


def check_signs(slots: Sequence[Slot], numbers: Array) -> None:
    """Check that no number is negative that must not be, and that gears lose and gain nothing.

    Args:
        numbers: Numbers in the slots of a design, shape (slots,), or of each design, shape (designs, slots).
    """
    for slot, own in zip(slots, np.atleast_2d(numbers).T, strict=True):
        if slot.table == "gears" and (out := (own > 1) | ((own <= 0) & (slot.field == "efficiency"))).any():
            first = int(np.flatnonzero(out)[0])
            design = "" if numbers.ndim == 1 else f" in design {first}"
            least = "above 0 and " if slot.field == "efficiency" else ""
            raise ModelError(
                f"{slot} must be {least}at most 1, not {own[first]:g}{design}", element=slot.name
            )
        if slot.field in NOT_NEGATIVE and (own < 0).any():
            first = int(np.flatnonzero(own < 0)[0])
            wrong = f"cannot be {own[0]:g}" if numbers.ndim == 1 else f"is negative in design {first}"
            raise ModelError(f"{slot} {wrong}", element=slot.name)
