"""The robot of a design: the study's robot with xacro arguments, scaled links, and numbers by expressions.

For compiled models, whose arguments are numbers of the description, the numbers of many designs at once.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

from ...description.reading import read
from ...description.records import Description
from ...spatial import Array
from ...structure.building import build_robot
from ...structure.parameters.xacro import text_of
from ...structure.robot import HybridRobot
from .stated_numbers import Numbers
from .study_file import StudyFile

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
