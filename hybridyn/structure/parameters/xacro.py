"""Arguments of a robot's xacro file as parameters: the numbers of the description that depend on them."""

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from ...description.names import did_you_mean
from ...description.reading import read
from ...description.records import Description
from ...description.urdf.xml_node import parse
from ...errors import ModelError
from ...spatial import Array
from ..robot import HybridRobot
from .effect_numbers import EFFECT_NUMBERS
from .ends import check_ends
from .shares import check_shares
from .slots import Slot, differences, values_of

#: Factors on all arguments at which the file is expanded to find what depends on them. A number that changes
#: at none of them, but at a design, is refused there.
PROBES = (1.013, 0.991)
#: Added to arguments that are zero.
PROBE_OF_ZERO = 1e-3
#: Effects of which the description's numbers stay where the file's own do not change: side-cars state them,
#: or the effects that are asked for.
STAY = tuple(effect for effect in EFFECT_NUMBERS if effect != "spring")
#: So many designs are remembered at most: gradients ask for the same ones again, for each of their results.
REMEMBERED = 1000


class XacroArguments:
    """Arguments of a robot's xacro file.

    Attributes:
        names: Their names.
        nominal: Their values in the robot's description, shape (size,).
        slots: The numbers of the description that depend on them.
    """

    def __init__(self, description: Description, names: Sequence[str]) -> None:
        """Find the values of arguments.

        Args:
            description: The robot's description.
            names: Names of arguments whose values are numbers.

        Raises:
            ModelError: The robot was not read from xacro, or an argument is unknown or no number.
        """
        self.names, self._description = tuple(names), description
        origin = description.read_from
        if origin is None or not (stated := _stated(origin.file)):
            raise ModelError(
                f"there is no parameter '{names[0]}': the robot was not read from a xacro file with "
                "arguments. Write KIND:NAME, such as mass:LINK",
                element=names[0],
            )
        self._origin, values = origin, stated | origin.xacro_args
        for name in names:
            if name not in values:
                raise ModelError(
                    f"there is no parameter '{name}'{did_you_mean(name, values)}: the file has the arguments "
                    f"{', '.join(values)}; for others write KIND:NAME, such as mass:LINK",
                    file=origin.file,
                    element=name,
                )
        self.nominal = np.array([_number(name, values[name], origin.file) for name in names])
        self._known: dict[tuple[float, ...], list[float]] = {}
        self._robot: HybridRobot | None = None
        self._ends: Sequence[tuple[str, str]] = ()
        self._probed: list[tuple[Array, Description]] = []

    def model(self, robot: HybridRobot, ends: Sequence[tuple[str, str]]) -> None:
        """State the robot whose models take the numbers: designs must share loads among motors as it does.

        Args:
            robot: The robot.
            ends: Joints and limits at which stops begin, also in designs, as `Effects.ends`.

        Raises:
            ModelError: Designs near it do not.
        """
        self._robot, self._ends = robot, ends
        for values, description in self._probed:
            self._check(values, description)

    @cached_property
    def slots(self) -> tuple[Slot, ...]:
        """The numbers of the description that depend on them.

        Raises:
            ModelError: The arguments change the structure, or the description is no longer that of the file.
        """
        if differences(self._description, self.expanded(self.nominal.tolist())):
            raise ModelError(
                "the robot's numbers are no longer those of its xacro file: take arguments of a robot that "
                "was loaded from it",
                file=self._origin.file,
            )
        found: set[Slot] = set()
        for probe in PROBES:
            values = np.where(self.nominal == 0.0, PROBE_OF_ZERO, probe * self.nominal)
            alone = np.where(np.eye(len(values), dtype=bool), values, self.nominal)
            found.update(*(self._changes(one) for one in (*alone, values)))
        return tuple(sorted(found))

    def _check(self, values: Array, description: Description) -> None:
        """Check the shares of motors and the ends in a design, where a model takes its numbers."""
        if self._robot is not None:
            try:
                check_shares(self._robot, description)
                check_ends(self._robot, description, self._ends)
            except ModelError as error:
                raise ModelError(f"with {self._text(values)}, {error}", element=error.element) from error

    def numbers(self, p: Array) -> tuple[Array, dict[int, ModelError]]:
        """Compute the numbers in the slots by expanding the file at each design.

        Args:
            p: Values of the arguments, shape (T, size).

        Returns:
            Shape (T, slots), NaN for designs that are not possible (another structure, or numbers change that
            did not change before), and the errors of these designs.
        """
        designs, which = np.unique(p, axis=0, return_inverse=True)
        rows, wrong = np.full((len(designs), len(self.slots)), np.nan), {}
        for k, design in enumerate(designs):
            try:
                rows[k] = self._numbers(design)
            except ModelError as error:
                wrong[k] = error
        place = which.ravel().tolist()
        return rows[place], {i: wrong[k] for i, k in enumerate(place) if k in wrong}

    def _numbers(self, values: Array) -> list[float]:
        """Return the numbers in the slots of one design; the file is not read again for one that is known.

        Raises:
            ModelError: The file is wrong with it, it has another structure, or other numbers change.
        """
        design = tuple(values.tolist())
        if design in self._known:
            return self._known[design]
        description = self.expanded(values.tolist())
        try:
            others = set(differences(self._description, description)) - set(self.slots)
        except ModelError as error:
            raise ModelError(f"with {self._text(values)}, {error}; compile a model of its own") from error
        if others:
            raise ModelError(
                f"with {self._text(values)}, {min(others)} changes, which did not change near the robot's "
                "own arguments: compile a model of its own"
            )
        self._check(values, description)
        if len(self._known) == REMEMBERED:
            self._known.clear()
        self._known[design] = found = values_of(description, self.slots)
        return found

    def own(self, _: Array) -> Array:
        """Return the values of the arguments, whatever the numbers in the slots."""
        return self.nominal

    def expanded(self, values: Sequence[Any]) -> Description:
        """Read the robot's file with other values of the arguments.

        Raises:
            ModelError: The file is wrong with them, or it changes numbers that are stated otherwise.
        """
        found = self._read(dict(zip(self.names, map(text_of, values), strict=True)))
        now = dict(found.effects)
        for name, numbers in self._description.effects:
            if name not in STAY:
                continue
            before, after = self._own_effects.get(name, {}), now.get(name, {})
            words = (word for word in before | after if after.get(word) != before.get(word))
            changed = {word: after.get(word) for word in words}
            if any(numbers.get(word) != before.get(word) for word in changed):
                raise ModelError(
                    f"the arguments change numbers of '{name}' in the file, but the robot or the effects "
                    "that are asked for state others: name one of both",
                    element=name,
                )
            found = found.with_effect(name, numbers | changed)
        return found

    @cached_property
    def _own_effects(self) -> dict[str, dict[str, Any]]:
        """The effects that the file states with the robot's arguments."""
        return dict(self._read({}).effects)

    def _read(self, arguments: dict[str, str]) -> Description:
        """Read the robot's file with other values of some arguments."""
        origin = self._origin
        return read(
            origin.file,
            motors=origin.motors,
            xacro_args={**origin.xacro_args, **arguments},
            package_dirs=origin.package_dirs,
        )

    def _changes(self, values: Array) -> list[Slot]:
        """Return the numbers that change with other values."""
        try:
            self._probed.append((values, self.expanded(values.tolist())))
            return differences(self._description, self._probed[-1][1])
        except ModelError as error:
            raise ModelError(f"with {self._text(values)}: {error}", file=self._origin.file) from error

    def _text(self, values: Array) -> str:
        """Describe values of the arguments in messages."""
        return ", ".join(f"{name} = {value:g}" for name, value in zip(self.names, values, strict=True))


def text_of(value: object) -> str:
    """Write the value of a xacro argument: whole numbers without a point, others to the last bit."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return value
    number = float(np.asarray(value, dtype=float))
    return str(int(number)) if number == int(number) else repr(number)


def _stated(file: str) -> dict[str, object]:
    """Return the arguments that a xacro file states, with their defaults; empty for another file."""
    with open(file, "rb") as stream:
        root = parse(stream.read(), file)
    arguments = [node for node in root.descendants() if node.tag == "xacro:arg"]
    return {node.text("name"): node.text("default") for node in arguments if "default" in node.attributes()}


def _number(name: str, value: object, file: str) -> float:
    try:
        return float(str(value))
    except ValueError:
        raise ModelError(
            f"xacro argument '{name}' is '{value}', which is no number: it cannot be a parameter", file=file
        ) from None
