"""The robot of a design: the study's robot with xacro arguments, scaled links, and numbers by expressions.

For compiled models, whose arguments are numbers of the description, the numbers of many designs at once.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from itertools import product
from typing import NamedTuple

import numpy as np

from ...description.reading import read
from ...description.records import Description
from ...errors import ModelError
from ...scenes.toml_source import naming
from ...spatial import Array, Mask
from ...structure.building import build_robot
from ...structure.parameters.entries import Entry, Parameters, entry_of
from ...structure.parameters.slots import NOT_NEGATIVE, Slot, differences, values_of, with_values
from ...structure.parameters.xacro import text_of
from ...structure.robot import HybridRobot
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
            ModelError: A name is unknown, a number is not finite, or a mass, a stiffness or a friction is
                negative.
        """
        if not self.expressions and not any(one.links for one in self.source.study.parameters.values()):
            return description
        slots, rows = self.in_slots(description, {name: np.array([value]) for name, value in values.items()})
        for slot, number in zip(slots, rows[0], strict=True):
            if not np.isfinite(number) or (slot.field in NOT_NEGATIVE and number < 0):
                where = "numbers" if self.expressions else "parameters"
                raise self.source.error((where,), f"{slot} cannot be {number:g}")
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


#: Most descriptions that are kept.
MOST_KNOWN = 64

#: The xacro arguments of a description, by name.
Key = tuple[tuple[str, str], ...]


class Variants:
    """Builds the robots of designs. What was read is kept: designs may differ in scales only."""

    def __init__(self, source: StudyFile) -> None:
        self.source, self.file, self.numbers = source, source.robot, Numbers(source)
        self._known: dict[Key, Description] = {}

    def __call__(self, values: Mapping[str, float]) -> HybridRobot:
        """Build the robot of a design.

        Raises:
            HybridynError: The files are wrong with these values, a link is unknown, or no posture closes the
                loops.
        """
        return self.robot(self.description(values))

    def description(self, values: Mapping[str, float]) -> Description:
        """Return the description of a design.

        Raises:
            HybridynError: The files are wrong with these values, or a link is unknown.
        """
        differing = {xacro: text_of(values[name]) for name, xacro in self.arguments.items()}
        return self.numbers.described(self._read(differing), values)

    def named(self, values: Array) -> dict[str, float]:
        """Return the values of a design's parameters by name.

        Args:
            values: The values, shape (parameters,).
        """
        return dict(zip(self.source.study.parameters, values.tolist(), strict=True))

    @cached_property
    def arguments(self) -> dict[str, str]:
        """The xacro argument that each parameter sets, by the parameter's name."""
        parameters = self.source.study.parameters
        return {
            name: one.xacro or name
            for name, one in parameters.items()
            if one.xacro or not (one.links or name in self.numbers.parameters)
        }

    @property
    def unscaled(self) -> Description:
        """Description of all designs without scales and stated numbers, where no xacro argument differs."""
        return self._read({})

    def robot(self, description: Description) -> HybridRobot:
        """Build the robot of a design's description.

        Raises:
            HybridynError: It is no robot, or no posture closes the loops.
        """
        stated = self.source.study.robot
        gravity = stated.gravity
        return build_robot(
            description,
            base=stated.base,
            gravity=None if gravity is None else (gravity[0], gravity[1], gravity[2]),
        )

    def _read(self, differing: dict[str, str]) -> Description:
        """Read the robot's file with the study's xacro arguments and those in which designs differ."""
        stated = self.source.study.robot
        arguments = {name: text_of(value) for name, value in stated.xacro.items()} | differing
        key = tuple(sorted(arguments.items()))
        if key not in self._known:
            if len(self._known) == MOST_KNOWN:
                self._known.clear()
            folders = [self.source.beside(folder) for folder in stated.package_dirs]
            self._known[key] = read(
                self.file, motors=stated.motors, xacro_args=arguments or None, package_dirs=folders,
                strict=stated.strict,
            )  # fmt: skip
        return self._known[key]


class Slotted(NamedTuple):
    """Designs that differ in slots only.

    Attributes:
        possible: Designs that do, shape (designs,).
        p: Numbers in the slots of those designs, shape (possible designs, slots).
        descriptions: Their descriptions, of which limits are read.
    """

    possible: Mask
    p: Array
    descriptions: Sequence[Description]


class SlotNumbers:
    """Computes the numbers in slots, without a description of each design where no xacro argument differs."""

    def __init__(self, variants: Variants, base: Description, slots: Sequence[Slot]) -> None:
        """Prepare the slots.

        Args:
            variants: Describes the designs.
            base: Description of the robot whose models are compiled.
            slots: The numbers that differ between designs.
        """
        self.variants, self.base, self.slots = variants, base, tuple(slots)
        self._signed = np.array([slot.field in NOT_NEGATIVE for slot in slots], dtype=bool)

    def __call__(self, values: Array) -> Slotted:
        """Compute the numbers.

        Args:
            values: Values of the study's parameters, shape (designs, parameters).
        """
        slotted = self._one_by_one(values) if self.variants.arguments else self._at_once(values)
        finite, positive = np.isfinite(slotted.p), slotted.p[:, self._signed] >= 0
        good: Mask = np.array(finite.all(axis=1) & positive.all(axis=1))
        if good.all():
            return slotted
        possible = slotted.possible.copy()
        possible[np.flatnonzero(possible)[~good]] = False
        described = [one for one, fine in zip(slotted.descriptions, good.tolist(), strict=True) if fine]
        return Slotted(possible, slotted.p[good], described)

    def _at_once(self, values: Array) -> Slotted:
        """Compute the numbers of designs that differ in scales of links and stated numbers."""
        columns = dict(zip(self.variants.source.study.parameters, values.T, strict=True))
        read = self.variants.unscaled
        slots, stated = self.variants.numbers.in_slots(read, columns)
        every = list(dict.fromkeys([*self.slots, *slots]))
        at = {slot: i for i, slot in enumerate(every)}
        rows = np.tile(values_of(read, every), (len(values), 1))
        rows[:, [at[slot] for slot in slots]] = stated
        own, rest = np.split(np.arange(len(every)), [len(self.slots)])
        possible = (rows[:, rest] == np.array(values_of(self.base, every))[rest]).all(axis=1)
        count = int(possible.sum())
        return Slotted(possible, rows[possible][:, own], [self.base] * count)

    def _one_by_one(self, values: Array) -> Slotted:
        """Compute the numbers from the description of each design."""
        found: list[Description] = []
        possible = np.zeros(len(values), dtype=bool)
        known = set(self.slots)
        for i, own in enumerate(values):
            try:
                description = self.variants.description(self.variants.named(own))
                possible[i] = not set(differences(self.base, description)) - known
            except Exception:  # the general path says what is wrong
                continue
            possible[i] &= _home(description) == _home(self.base)
            if possible[i]:
                found.append(description)
        rows = [values_of(description, self.slots) for description in found]
        return Slotted(possible, np.array(rows).reshape(len(found), len(self.slots)), found)


def by_structure(descriptions: Sequence[Description]) -> list[list[int]]:
    """Return the places of descriptions that differ in slots only, group by group, the largest first."""
    groups: list[list[int]] = []
    for place, description in enumerate(descriptions):
        group = next((own for own in groups if _alike(descriptions[own[0]], description)), None)
        if group is None:
            groups.append([place])
        else:
            group.append(place)
    return sorted(groups, key=len, reverse=True)


def _alike(one: Description, other: Description) -> bool:
    """Return whether two descriptions differ in slots only."""
    try:
        differences(one, other)
    except ModelError:
        return False
    return True


def _home(description: Description) -> tuple[object, ...]:
    return description.home, description.base_home
