"""Coefficients of effects as arguments."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from ...effects.choice import Effects
from ...effects.gears import OnGears, on_gears
from ...effects.joints import OnJoints, placed
from ...effects.link_effect import LinkEffect
from ...effects.load_friction import OnLoads, on_loads
from ...effects.tendons import OnTendons, on_tendons
from ...errors import ModelError
from ...structure.parameters.effect_numbers import EFFECT_NUMBERS, stated_numbers
from ...structure.parameters.entries import OF_EFFECTS, effect_of, name_of
from ...structure.parameters.slots import Slot
from ...structure.robot import HybridRobot

if TYPE_CHECKING:
    from ...symbols import Expression


def slots_of(robot: HybridRobot, law: OnJoints | OnTendons, i: int) -> list[Slot | None]:
    """Return for each coefficient of a law's freedom i the number of the description that it is, or None."""
    if isinstance(law, OnTendons):
        name, width = law.effect.name, width_slot(law.effect)
        known = {"": None, "width": width}
        return [known.get(word, Slot(name, tendon, word)) for tendon, word in law.fields]
    if not {law.effect.name} & {*EFFECT_NUMBERS, *OF_EFFECTS}:
        return [None] * len(law.p)
    effect, joint = law.effect, _joint_of(robot, law, i)
    out: list[Slot | None] = [
        Slot(effect.name, joint, field, at) if field else None
        for field, at in effect.fields(len(law.p) - len(effect.for_all))
    ]
    if getattr(effect, effect.by_joint[0]) is None:
        out[0] = Slot("joints", joint, OF_EFFECTS[effect.name])
    return [*out, *(Slot(effect.name, effect.name, field) for field in effect.for_all)]


def friction_slots(law: OnLoads | None, joint: str) -> list[Slot]:
    """Return the numbers of the description that load friction of a joint has.

    They are those of its terms, static part, Stribeck velocity and width.
    """
    if law is None or joint not in law.joints:
        return []
    effect, terms = law.effect.name, np.flatnonzero(law.of_joint == law.joints.index(joint))
    words = *(law.words[k] for k in terms), "static", "speed"
    return [*(Slot(effect, joint, word) for word in words), width_slot(law.effect)]


def gear_slots(gears: OnGears | None, motor: str) -> list[Slot]:
    """Return the numbers of the description that the efficiency of a motor's gear is, and back if stated."""
    if gears is None or motor not in gears.effect.efficiency:
        return []
    fields = ("efficiency",) if gears.effect.back is None else ("efficiency", "back")
    return [Slot(gears.effect.name, motor, field) for field in fields]


def width_slot(effect: Any) -> Slot:
    """Return the number of the description that the width of an effect is."""
    return Slot(effect.name, effect.name, "width")


def _joint_of(robot: HybridRobot, law: OnJoints, i: int) -> str:
    """Return the joint of a law's freedom i."""
    at = int(law.columns[i])
    return next(n for n, own in zip(robot.joints, robot.v_slices, strict=True) if own.start <= at < own.stop)


def _laws(effects: Effects) -> Iterator[Any]:
    """Yield the effects whose numbers may be parameters."""
    on_joints = [law.effect for law in (*effects.joints, effects.loaded, effects.gears) if law is not None]
    yield from (effect for effect in (*on_joints, *effects.links) if effect.name in EFFECT_NUMBERS)


def _plain(numbers: Any) -> Any:
    """Return an array as a list; other numbers stay."""
    return numbers.tolist() if isinstance(numbers, np.ndarray) else numbers


def _tables(effects: Effects) -> dict[str, dict[str, Any]]:
    """Return the numbers of effects as files state them, but of effects that state one number twice."""
    out, twice = dict[str, dict[str, Any]](), set[str]()
    for effect in _laws(effects):
        tables = out.setdefault(effect.name, {})
        for word in (one.name for one in fields(effect)):
            numbers, known = getattr(effect, word), tables.get(word)
            if isinstance(numbers, Mapping):
                if known and {*known} & {*numbers}:
                    twice.add(effect.name)
                tables[word] = (known or {}) | {name: _plain(x) for name, x in numbers.items()}
            elif numbers is not None:
                if known not in (None, float(numbers)):
                    twice.add(effect.name)
                tables[word] = float(numbers)
    return {name: tables for name, tables in out.items() if tables and name not in twice}


def with_arguments_in(law: LinkEffect, slots: Sequence[Slot], column: Expression) -> LinkEffect:
    """Return a law of wrenches whose numbers that are arguments are expressions.

    Args:
        slots: Those of the arguments.
        column: Symbols of them.
    """
    own = {slot: column[i] for i, slot in enumerate(slots) if slot.table == law.name}
    if not own:
        return law
    out = copy(law)
    for slot, symbol in own.items():
        table = getattr(out, slot.field)
        if slot.index:
            entries = [*table[slot.name]]
            entries[slot.index[0]] = symbol
            symbol = entries
        value = symbol if slot.name == law.name else {**table, slot.name: symbol}
        object.__setattr__(out, slot.field, value)  # what a frozen law checks are numbers
    return out


def _refuse_several(name: str, effect: str) -> NoReturn:
    raise ModelError(
        f"parameter '{name}': several effects '{effect}' act with numbers of their own: a model with such "
        "parameters takes one",
        element=name.partition(":")[2],
    )


def with_stated_effects(
    robot: HybridRobot, effects: Effects, parameters: Sequence[str | Slot]
) -> HybridRobot:
    """Return a robot whose description states the numbers of its models' effects, which may be parameters.

    Raises:
        ModelError: Several effects state the number that a parameter names.
    """
    description, known = robot.description, _tables(effects)
    several = {effect.name for effect in _laws(effects)} - {*known}
    for name in parameters:
        if isinstance(name, str) and (effect := effect_of(name)) and effect in several:
            _refuse_several(name, effect)
    for name, tables in known.items():
        description = description.with_effect(name, {word: x for word, x in tables.items() if x != {}})
    return replace(robot, description=description)


def at_robot(effects: Effects, robot: HybridRobot) -> Effects:
    """Return effects whose laws have the coefficients of another robot's description."""
    known, numbers = _tables(effects), dict(stated_numbers(robot.description))

    def stated(effect: Any) -> Any:
        """Return an effect with the coefficients of the description."""
        if effect.name not in known:
            return effect
        names = {
            name for word in EFFECT_NUMBERS[effect.name]
            if isinstance(table := getattr(effect, word), Mapping) for name in table
        }  # fmt: skip
        tables: dict[str, Any] = {}
        for word in EFFECT_NUMBERS[effect.name]:
            before = getattr(effect, word)
            if isinstance(before, Mapping):
                own = {name: numbers.get((effect.name, name, word)) for name in names}
                tables[word] = {name: x for name, x in own.items() if name in before or x}
            elif before is not None:
                tables[word] = numbers[effect.name, effect.name, word]
        return replace(effect, **tables)

    def laws(group: Sequence[Any]) -> tuple[Any, ...]:
        """Return laws with the coefficients of the description."""
        found = (
            (on_tendons if isinstance(one, OnTendons) else placed)(stated(one.effect), robot) for one in group
        )
        return tuple(law for law in found if law is not None)

    return replace(
        effects,
        loaded=None if effects.loaded is None else on_loads(stated(effects.loaded.effect), robot),
        gears=None if effects.gears is None else on_gears(stated(effects.gears.effect), robot),
        joints=laws(effects.joints),
        rotors=laws(effects.rotors),
        links=tuple(stated(law).bound(robot) for law in effects.links),
    )


def check_coefficients(robot: HybridRobot, effects: Effects, slots: tuple[Slot, ...]) -> None:
    """Check that a law uses each coefficient that is an argument.

    Raises:
        ModelError: The effect is off, several of them state the number, or the coefficient is zero in the
            robot's files.
    """
    used = {
        slot for law in effects.joints for i in range(len(law.columns)) for slot in slots_of(robot, law, i)
    }
    for joint in robot.joints:
        used.update(friction_slots(effects.loaded, joint))
    if (gears := effects.gears) is not None:
        used.update(slot for motor in robot.motors for slot in gear_slots(gears, motor))
        used.add(width_slot(gears.effect))
    known = _tables(effects)
    on_links = {law.name for law in effects.links}
    of_files = {field: name for name, field in OF_EFFECTS.items()}
    for slot in slots:
        of_file = slot.table == "joints" and slot.field in of_files
        if not of_file and slot.table not in EFFECT_NUMBERS:
            continue
        name = f"{of_files[slot.field]}:{slot.name}" if of_file else name_of(slot)
        kind = name.partition(":")[0]
        if slot not in used and slot.table not in on_links:
            raise ModelError(
                f"parameter '{name}': '{kind}' does not act on the joint with a number of the robot's files; "
                "name the effect in effects=, or state a coefficient that is not zero",
                element=slot.name,
            )
        if not of_file and slot.table not in known:
            _refuse_several(name, slot.table)
