"""Slots: single numbers of a description, which can be read and replaced."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from ...description.names import did_you_mean
from ...description.records import Description
from ...description.residual_frames import joints_of_frames
from ...errors import ModelError
from ...spatial import Array, Mask
from ..bodies import loaded
from .effect_numbers import ANY, EFFECT_NUMBERS, NOT_NEGATIVE, ORDERED, Range, stated_numbers, with_numbers

#: Fields with slots, by the tuple of a description.
NUMBERS = {
    "links": ("mass", "com", "inertia"),
    "joints": ("placement", "damping", "friction"),
    "closures": ("frame_a", "frame_b"),
    "couplings": ("offset",),
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
        table: One of `TABLES`, or an effect of `EFFECT_NUMBERS`.
        name: Name of the record; of an effect's number that of the joint, motor, tendon, line or bushing, or
            of the effect.
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
    of_effects = dict(stated_numbers(description))

    def field_of(slot: Slot) -> Any:
        """Return the field in which a slot is."""
        if slot.table in EFFECT_NUMBERS:
            return of_effects[slot.table, slot.name, slot.field]
        return getattr(records[slot.table][slot.name], slot.field)

    return [float(np.asarray(field_of(slot))[slot.index]) for slot in slots]


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
    given = dict(zip(slots, values, strict=True))
    description = _with_effects(description, {s: x for s, x in given.items() if s.table in EFFECT_NUMBERS})
    for slot, value in given.items():
        if slot.table in EFFECT_NUMBERS:
            continue
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
    if "loads" in tables:
        of = {load.name: load for load in tables["loads"] if ("loads", load.name) in changes}
        links = tables.get("links", description.links)
        tables["links"] = tuple(loaded(link, of[link.name]) if link.name in of else link for link in links)
    return replace(description, **tables)


def _with_effects(description: Description, values: Mapping[Slot, Any]) -> Description:
    """Return a description whose effects state other numbers."""
    stated = dict(stated_numbers(description))
    numbers: dict[tuple[str, str, str], Any] = {}
    for slot, value in values.items():
        key = slot.table, slot.name, slot.field
        if slot.index:
            entries = [*numbers.get(key, stated[key])]
            entries[slot.index[0]] = value
            value = entries
        numbers[key] = value
    return with_numbers(description, numbers)


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
    load by their effort limits, which `check_shares` compares.

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
    numbers = tuple({key: np.asarray(x) for key, x in stated_numbers(each)} for each in (one, other))
    shapes = [{key: x.shape for key, x in own.items()} for own in numbers]
    for field in ("motors", "effects", "base", "gravity"):
        mine, others = getattr(one, field), getattr(other, field)
        if field == "effects":
            mine, others = ((_without_slots(x), y) for x, y in zip((mine, others), shapes, strict=True))
        if mine != others:
            raise ModelError(f"the {field} are others: the robot has another structure")
    for key, own in numbers[0].items():
        out += [Slot(*key, tuple(at)) for at in np.argwhere(own != numbers[1][key]).tolist()]
    return out


def _without_slots(effects: Sequence[tuple[str, dict[str, Any]]]) -> dict[str, dict[str, Any]]:
    """Return effects without the numbers that have slots."""
    return {
        name: {word: x for word, x in values.items() if word not in EFFECT_NUMBERS.get(name, ())}
        for name, values in effects
    }


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


def range_of(slot: Slot) -> Range:
    """Return what the number in a slot may be, in parameters as in files."""
    if slot.table in EFFECT_NUMBERS:
        return EFFECT_NUMBERS[slot.table][slot.field].range
    return NOT_NEGATIVE if slot.field in ("mass", "damping", "friction") else ANY


def wrong_numbers(
    slots: Sequence[Slot], numbers: Array, description: Description
) -> Iterator[tuple[Slot, Array, Mask, str]]:
    """Yield slots of which numbers are wrong, their numbers, which of these are wrong, and what they must be.

    Args:
        numbers: Of each design, shape (designs, slots).
        description: States those that have no slot here.
    """
    if not slots:
        return
    held = [range_of(slot) for slot in slots]
    together: Any = map(np.array, zip(*held, strict=True))
    missed = Range(*together).misses(numbers)
    some = set(np.flatnonzero(missed.any(axis=0)).tolist())
    ordered = any(slot.table in ORDERED for slot in slots)
    rows = dict(zip(slots, numbers.T, strict=True)) if ordered else {}
    known = dict(stated_numbers(description)) if ordered else {}
    for i, slot in enumerate(slots):
        own = numbers[:, i]
        if i in some:
            yield slot, own, missed[:, i], str(held[i])
        if slot.table in ORDERED and slot.field in (words := ORDERED[slot.table]):
            less, more = (_number(replace(slot, field=word), rows, known, description) for word in words)
            wrong = np.broadcast_to(less > more, own.shape)
            if wrong.any():
                bound = f"at most {words[1]}" if slot.field == words[0] else f"at least {words[0]}"
                yield slot, own, wrong, bound


def _number(
    slot: Slot,
    rows: Mapping[Slot, Array],
    known: Mapping[tuple[str, str, str], Any],
    description: Description,
) -> Any:
    """Return the number in a slot, or those of designs; a limit that no stop states is the joint's own.

    Args:
        rows: Those of designs.
        known: Those that effects of the description state.
    """
    if slot in rows:
        return rows[slot]
    if (key := (slot.table, slot.name, slot.field)) in known:
        return known[key]
    return next(getattr(joint, slot.field) for joint in description.joints if joint.name == slot.name)


def check_numbers(slots: Sequence[Slot], numbers: Array, description: Description) -> None:
    """Check that numbers are what files may state.

    Args:
        numbers: Numbers in the slots of a design, shape (slots,), or of each design, shape (designs, slots).
        description: States those that have no slot here.
    """
    for slot, own, wrong, needed in wrong_numbers(slots, np.atleast_2d(numbers), description):
        first = int(np.flatnonzero(wrong)[0])
        design = "" if numbers.ndim == 1 else f" in design {first}"
        told = f"must be {needed}, not {own[first]:g}{design}"
        if range_of(slot) == NOT_NEGATIVE and own[first] < 0:
            told = f"is negative{design}" if design else f"cannot be {own[first]:g}"
        raise ModelError(f"{slot} {told}", element=slot.name)
