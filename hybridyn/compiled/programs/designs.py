"""Compiled models at chosen parameters: arguments of a batch, and the general path for each design."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from ...effects.choice import Effects
from ...errors import HybridynError, ModelError, TrajectoryError
from ...spatial import Array, Index
from ...structure.building import rebuilt
from ...structure.parameters.chosen import Parameters
from ...structure.parameters.slots import with_values
from ...structure.robot import HybridRobot
from ..equations.coefficients import at_robot
from .general import general_rows
from .sources import kept

#: Factors on the parameters of designs at which a new model is verified; positions stay on their lines.
SCALED = (1.03, 0.98)
#: How far one coordinate of each position moves in the last such design, as a part of the largest one.
BESIDE = 0.02
#: Number of robots that are kept for samples that the general path computes.
KEPT_ROBOTS = 8


def designs_to_verify(
    robot: HybridRobot, parameters: Parameters
) -> Iterator[tuple[Array, HybridRobot, bool]]:
    """Yield designs at which a new model is verified: numbers in slots, the robot, if it must work."""
    yield parameters.slot_values(parameters.nominal[None])[0], robot, True
    designs: list[list[Array]] = []
    if parameters.size:
        designs = [[parameters.near(x)] for x in SCALED]
        designs += [[parameters.beside(BESIDE, place) for place in (0, 1)]]  # the first may leave a plane
    for same in designs:
        for p in same:
            with contextlib.suppress(HybridynError):  # no such robot
                numbers = parameters.slot_values(p[None])[0]
                yield numbers, changed(robot, parameters, numbers), False
                break


def changed(robot: HybridRobot, parameters: Parameters, numbers: Array) -> HybridRobot:
    """Build the robot with numbers in the slots of parameters, shape (slots,).

    Raises:
        HybridynError: There is no such robot.
    """
    parameters.check(numbers)
    return rebuilt(robot, with_values(robot.description, parameters.slots, numbers.tolist()), like=robot)


class DesignsInSlots:
    """The designs of calls of one compiled robot."""

    def __init__(self, robot: HybridRobot, effects: Effects, parameters: Parameters) -> None:
        self.robot, self.effects, self.parameters = robot, effects, parameters
        self._nominal = parameters.slot_values(parameters.nominal[None])[0]
        self._robots: dict[bytes, HybridRobot] = {}

    def numbers(self, p: ArrayLike | None, shape: tuple[int, ...]) -> Array:
        """Return the numbers in the slots for each sample.

        Args:
            p: Parameters, shape (k,) or (T, k); None for those of the description.
            shape: Shape of the samples, () or (T,).

        Raises:
            ModelError: The model was compiled without parameters, or a number is out of the range that files
                may state.
            TrajectoryError: The shape is wrong, or a number is not finite.
        """
        size = self.parameters.size
        if p is None:
            return np.broadcast_to(self._nominal, (*shape, len(self._nominal)))
        if not size:
            raise ModelError(
                "this model has no parameters: name them in hybridyn.compile(robot, parameters=)"
            )
        values = np.asarray(p, dtype=float)
        if values.shape not in ((size,), (*shape, size)) or not np.isfinite(values).all():
            raise TrajectoryError(
                f"parameters has shape {values.shape}; wanted finite numbers of shape ({size},)"
                + (f" or {(*shape, size)}" if shape else "")
                + f" ({', '.join(self.parameters.labels[:6])}{', ...' if size > 6 else ''})"
            )
        slots = self.parameters.slot_values(np.atleast_2d(values))
        self.parameters.check(slots)
        return slots[0] if not shape else np.broadcast_to(slots, (*shape, slots.shape[1]))

    def possible(self, p: Array) -> tuple[Array, dict[int, ModelError]]:
        """Return the numbers in the slots of designs, NaN for those of another structure, and their errors.

        Args:
            p: Parameters of each design, shape (designs, k).
        """
        if p.shape[1:] != (self.parameters.size,) or not np.isfinite(p).all():
            return self.numbers(p, (len(p),)), {}  # says what is wrong
        slots, errors = self.parameters.possible(p)
        self.parameters.check(slots)
        return slots, errors

    def general(self, name: str, given: Mapping[str, Array], rows: Index) -> Array:
        """Compute a model of some samples by the general path, each with its numbers in the slots.

        Args:
            name: Name of the model.
            given: Its arguments by name, shape (T, width) each; "parameters" are the numbers.
            rows: Numbers of the samples, at least one.

        Raises:
            HybridynError: A design is no robot, or a sample is wrong; the message has its number.
        """
        states = dict(given)
        numbers = states.pop("parameters", np.zeros((len(states["q"]), 0)))
        designs, which = np.unique(numbers[rows], axis=0, return_inverse=True)
        parts = []
        for n, design in enumerate(designs):
            robot = self.robot_of(design)
            own = rows[which.ravel() == n]
            parts.append((own, general_rows(robot, self.effects_of(robot), name, states, own)))
        order = np.argsort(np.concatenate([own for own, _ in parts]))
        out: Array = np.concatenate([part for _, part in parts])[order]
        return out

    def effects_of(self, robot: HybridRobot) -> Effects:
        """Return the effects of a design: their numbers belong to its robot."""
        return self.effects if robot is self.robot else at_robot(self.effects, robot)

    def robot_of(self, numbers: Array) -> HybridRobot:
        """Return the robot with numbers in the slots, shape (slots,); the last few are kept.

        Raises:
            HybridynError: There is no such robot.
        """
        if np.array_equal(numbers, self._nominal):
            return self.robot
        make = partial(changed, self.robot, self.parameters, numbers)
        return kept(self._robots, numbers.tobytes(), make, KEPT_ROBOTS)
