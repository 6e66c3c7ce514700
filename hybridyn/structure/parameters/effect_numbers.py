"""Numbers that the effects of a description state and parameters may set: which, how large, and where."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ...description.records import Description
from ...spatial import Array, Mask


class Range(NamedTuple):
    """What a number may be: finite, from `least`, or above it where it is `open`, to `most`."""

    least: float = -np.inf
    most: float = np.inf
    open: bool = False

    def misses(self, numbers: Array) -> Mask:
        """Return which numbers it does not hold."""
        out: Mask = (numbers < self.least) | (self.open & (numbers == self.least)) | (numbers > self.most)
        return out

    def __str__(self) -> str:
        """Describe it in messages."""
        bounds = [f"{'above' if self.open else 'at least'} {self.least:g}"] if self.least > -np.inf else []
        return " and ".join([*bounds, f"at most {self.most:g}"] if self.most < np.inf else bounds)


ANY, NOT_NEGATIVE, POSITIVE = Range(), Range(0.0), Range(0.0, open=True)


class Word(NamedTuple):
    """A key of an effect whose numbers may be parameters.

    Attributes:
        range: What they may be.
        default: The number of a joint that only other keys name; None if it has none.
        shared: Whether it is one number for all joints, which goes by the effect's name.
    """

    range: Range
    default: float | None = None
    shared: bool = False


#: The coefficients of load friction.
LOAD_FRICTION = ("radial", "axial", "tilt", "normal")
_WIDTH = {"width": Word(POSITIVE, shared=True)}
_LENGTHS = {
    **{word: Word(NOT_NEGATIVE, 0.0) for word in ("stiffness", "damping", "friction")},
    **{word: Word(ANY, 0.0) for word in ("lower", "upper")}, **_WIDTH,
}  # fmt: skip
#: The keys of each effect whose numbers may be parameters: by joint, motor, tendon, line, bushing, or shared.
EFFECT_NUMBERS: dict[str, dict[str, Word]] = {
    "coulomb_friction": {"level": Word(NOT_NEGATIVE), **_WIDTH},
    "stribeck_friction": {
        "level": Word(NOT_NEGATIVE), "static": Word(NOT_NEGATIVE), "speed": Word(POSITIVE), **_WIDTH,
    },
    "directed_friction": {"forward": Word(NOT_NEGATIVE), "backward": Word(NOT_NEGATIVE), **_WIDTH},
    "damper": {"coefficient": Word(NOT_NEGATIVE)},
    "spring": {"stiffness": Word(NOT_NEGATIVE), "rest": Word(ANY, 0.0)},
    "stop": {
        "stiffness": Word(NOT_NEGATIVE), "lower": Word(ANY), "upper": Word(ANY),
        "damping": Word(NOT_NEGATIVE, shared=True),
    },
    "polynomial_spring": {"coefficients": Word(ANY), "rest": Word(ANY, 0.0)},
    "polynomial_damper": {"coefficients": Word(ANY)},
    "ball_spring": {"stiffness": Word(NOT_NEGATIVE)},
    "load_friction": {
        **{word: Word(NOT_NEGATIVE, 0.0) for word in LOAD_FRICTION},
        "static": Word(Range(1.0)), "speed": Word(POSITIVE), **_WIDTH,
    },
    "gear_efficiency": {
        "efficiency": Word(Range(0.0, 1.0, open=True)), "back": Word(Range(most=1.0)), **_WIDTH,
    },
    "tendons": _LENGTHS,
    "line_springs": _LENGTHS | {word: Word(NOT_NEGATIVE, 0.0) for word in ("lower", "upper")},
    "bushings": dict.fromkeys(
        ("torque_stiffness", "torque_damping", "force_stiffness", "force_damping"), Word(NOT_NEGATIVE)
    ),
    "ground_contact": {
        **{word: Word(NOT_NEGATIVE, shared=True) for word in ("stiffness", "damping", "friction")},
        "height": Word(ANY, shared=True), **_WIDTH,
    },
}  # fmt: skip
#: Keys of one name of which the first must not be more than the second.
ORDERED = {"stribeck_friction": ("level", "static")} | dict.fromkeys(
    ("stop", "tendons", "line_springs"), ("lower", "upper")
)


def _named(words: Mapping[str, Word], values: Mapping[str, Any]) -> dict[str, None]:
    """Return the joints, motors, tendons, lines or bushings that a table of an effect names."""
    tables = (values.get(word) or {} for word, of in words.items() if not of.shared)
    return dict.fromkeys(name for table in tables for name in table)


def stated_numbers(description: Description) -> Iterator[tuple[tuple[str, str, str], Any]]:
    """Yield effect, name and key of each number that may be a parameter, and its value.

    The name is that of a joint, motor, tendon, line or bushing, or of the effect where all share a number.
    Some values are lists.
    """
    for effect, values in description.effects:
        words = EFFECT_NUMBERS.get(effect, {})
        names = _named(words, values)
        for word, of in words.items():
            table = {effect: values.get(word)} if of.shared else values.get(word) or {}
            for name in [effect] if of.shared else names:
                if (number := table.get(name, of.default)) is not None:
                    yield (effect, name, word), number


def with_numbers(description: Description, numbers: Mapping[tuple[str, str, str], Any]) -> Description:
    """Return a description whose effects state other numbers, by effect, name and key."""
    effects = []
    for effect, values in description.effects:
        words = EFFECT_NUMBERS.get(effect, {})
        names, tables = _named(words, values), dict(values)
        for (own, name, word), number in numbers.items():
            if own != effect:
                continue
            if words[word].shared:
                tables |= {word: number} if values.get(word) is not None else {}
            elif name in names and not _is_left_out(number, words[word], name, values.get(word) or {}):
                tables[word] = {**(tables.get(word) or {}), name: number}
        effects.append((effect, tables))
    return replace(description, effects=tuple(effects))


def _is_left_out(number: Any, word: Word, name: str, table: Mapping[str, Any]) -> bool:
    """Return whether a number is the default of one that is not stated; traced ones are not compared."""
    return name not in table and isinstance(number, float | int) and number == word.default
