"""Derivatives of a robot's models by kernels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..compiled import RobotPrograms, as_compile_error
from ..effects.choice import Effects
from ..structure.parameters.slots import Slot
from ..structure.robot import HybridRobot
from .functions import InWarp, in_warp, of_program
from .launching import Launcher

#: Type of numbers in derivatives.
DTYPE = "float64"


class DerivativeKernels:
    """The programs behind `hybridyn.SecondDerivatives`, launched for many samples."""

    def __init__(
        self, robot: HybridRobot, effects: Effects, slots: Sequence[Slot], launcher: Launcher
    ) -> None:
        """Take a robot; a program is written, and built by Warp, at its first use.

        Args:
            robot: The robot.
            effects: Its effects.
            slots: Numbers of the description that programs read, "parameters".
            launcher: Launches the kernels; its batch has numbers of the type `DTYPE`.
        """
        self._programs, self._launcher = RobotPrograms(robot, effects, slots), launcher
        self._made: dict[tuple[str, str], InWarp] = {}

    def run(self, model: str, what: str, *given: Any) -> dict[str, Any]:
        """Run a program; results of samples in doubt are NaN.

        Args:
            model: "close", over the motors, or "idm" or "ddm", over the joints.
            what: "product" or "path".
            given: Inputs in their order, shapes (N, n): the state, parameters if there are, the direction
                (of a path its change, too), and of a product the weights.

        Returns:
            Results by name, arrays of the kind of the first input.

        Raises:
            HybridynError: The program cannot be written, or the device is full.
        """
        if (model, what) not in self._made:
            with as_compile_error(self._programs.robot):
                program = self._programs.second(model, what, "motors" if model == "close" else "joints")
                self._made[model, what] = in_warp(of_program(program, DTYPE), DTYPE)
        made = self._made[model, what]
        names = [name for name, _ in made.native.inputs]
        found = self._launcher.run(made, dict(zip(names, given, strict=True)))
        return {name: x for (name, _), x in zip(made.native.outputs, found, strict=False)}
