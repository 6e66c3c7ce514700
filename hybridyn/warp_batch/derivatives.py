"""Derivatives of a robot's models by kernels."""

from __future__ import annotations

from typing import Any

from ..compiled import RobotPrograms, as_compile_error
from .functions import InWarp, in_warp, of_program
from .launching import Launcher

#: Type of numbers in derivatives.
DTYPE = "float64"


class DerivativeKernels:
    """The programs behind `hybridyn.SecondDerivatives`, launched for many samples."""

    def __init__(self, programs: RobotPrograms, launcher: Launcher) -> None:
        """Take the programs of a robot; each is written, and built by Warp, at its first use."""
        self._programs, self._launcher = programs, launcher
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
