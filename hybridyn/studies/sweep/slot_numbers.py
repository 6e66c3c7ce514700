"""Designs that differ in numbers alone: what compiled models compute without a robot of each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...description.records import Description
from ...errors import ModelError
from ...spatial import Array, Mask
from ...structure.parameters.ends import check_ends
from ...structure.parameters.shares import check_shares
from ...structure.parameters.slots import Slot, differences, values_of, wrong_numbers
from ...structure.robot import HybridRobot
from .variants import Variants


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

    def __init__(
        self, variants: Variants, robot: HybridRobot, slots: Sequence[Slot], ends: Sequence[tuple[str, str]]
    ) -> None:
        """Prepare the slots.

        Args:
            variants: Describes the designs.
            robot: The robot whose models are compiled.
            slots: The numbers that differ between designs.
            ends: Joints and limits at which stops begin, in all designs, as `Effects.ends`.
        """
        self.variants, self.robot, self.slots, self.ends = variants, robot, tuple(slots), ends
        self.base = robot.description

    def __call__(self, values: Array) -> Slotted:
        """Compute the numbers.

        Args:
            values: Values of the study's parameters, shape (designs, parameters).
        """
        slotted = self._one_by_one(values) if self.variants.arguments else self._at_once(values)
        bad = ~np.isfinite(slotted.p).all(axis=1)
        for _, _, wrong, _ in wrong_numbers(self.slots, slotted.p, self.base):
            bad |= wrong
        good: Mask = np.array(~bad)
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
                check_shares(self.robot, description)
                check_ends(self.robot, description, self.ends)
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
