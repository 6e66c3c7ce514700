"""The general path behind a batch: it computes samples in doubt, and is what new models are compared with."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np

from ..assembly.assemble import assemble
from ..compiled.equations.arguments.coefficients import at_robot
from ..compiled.programs.designs import DesignsInSlots
from ..compiled.programs.general import general_rows
from ..compiled.verifying import verify
from ..dynamics.inverse import idm
from ..effects.choice import Effects
from ..spatial import Array, Index
from ..structure.robot import HybridRobot


class General:
    """Functions of the general path for some samples of a batch."""

    def __init__(self, robot: HybridRobot, effects: Effects, designs: DesignsInSlots) -> None:
        self._robot, self._effects, self._designs = robot, effects, designs

    def model(self, name: str, rows: Index, given: dict[str, Array]) -> Sequence[Array]:
        """Compute "idm" or "ddm" of some samples, each with its parameters.

        Args:
            rows: Numbers of the samples.
            given: All inputs by name, shape (N, width) each.
        """
        given = dict(given)
        numbers = given.pop("parameters", np.zeros((len(given["q"]), 0)))
        parts = [
            (own, general_rows(robot, self._at(robot), name, given, own))
            for robot, own in self._designs.by_design(numbers, rows)
        ]
        order = np.argsort(np.concatenate([own for own, _ in parts]))
        return [np.concatenate([part for _, part in parts])[order]]

    def close(self, rows: Index, given: dict[str, Array]) -> Sequence[Array]:
        """Compute "close" of some samples, each from its own posture."""
        states = [self._closed(robot, row, given)[1:] for robot, row in self._each(rows, given)]
        return [np.array(x) for x in zip(*states, strict=True)]

    def control(self, rows: Index, given: dict[str, Array]) -> Sequence[Array]:
        """Compute "idm_from_motors" of some samples."""
        found = [self._closed(robot, row, given) for robot, row in self._each(rows, given)]
        efforts = [idm(robot, q, v, a, effects=self._at(robot)) for robot, q, v, a in found]
        return [*(np.array(x) for x in list(zip(*found, strict=True))[1:]), np.array(efforts)]

    def _each(self, rows: Index, given: dict[str, Array]) -> list[tuple[HybridRobot, int]]:
        """Return the robot of each sample."""
        numbers = given.get("parameters", np.zeros((len(given["position"]), 0)))
        return [(self._designs.robot_of(numbers[row]), int(row)) for row in rows]

    def _closed(self, robot: HybridRobot, row: int, given: dict[str, Array]) -> tuple[Any, ...]:
        """Return the robot of a sample, and its motion from the motors'."""
        levels = (given[name][row] for name in ("position", "rate", "acceleration"))
        motors = dict(zip(robot.motors, zip(*levels, strict=True), strict=True))
        return (robot, *assemble(robot, motors=motors, guess=given["near"][row]))

    def _at(self, robot: HybridRobot) -> Effects:
        return self._effects if robot is self._robot else at_robot(self._effects, robot)

    def check(self, name: str, dtype: str, run: Callable[[dict[str, Any]], Any]) -> None:
        """Compare a new model with the general path at random states, see `compiled.verifying.verify`.

        Args:
            run: Computes results and guards from the inputs by name.

        Raises:
            CompileError: They differ.
        """
        last = ("a",) if name == "idm" else ("tau",)
        names = [
            "q",
            "v",
            *last,
            *(["base_acceleration"] if self._robot.base == "moving" and name == "ddm" else []),
        ]
        design = self._designs.numbers(None, ()) if self._designs.parameters.size else None
        names += [] if design is None else ["parameters"]

        def batch(_: str, *inputs: Array) -> tuple[tuple[Any, ...], Any]:
            *results, guard = run(dict(zip(names, inputs, strict=True)))
            return tuple(results), guard

        library = SimpleNamespace(dtype=dtype, programs={name: None}, batch=batch)
        verify(library, self._robot, self._effects, design=design)
