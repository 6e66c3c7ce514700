"""Written-out models run by CasADi, without a compiler, as a library of them."""

from typing import Any

import numpy as np

from hybridyn.compiled.programs.whole_robot import function_of, programs
from hybridyn.structure.robot import HybridRobot


class Interpreted:
    """What `hybridyn.compiled.library.calls.Library` offers to `verify`, slow and without a compiler."""

    dtype = np.dtype("float64")

    def __init__(
        self, robot: HybridRobot, models: tuple[str, ...] = ("idm", "ddm", "kinematics"), effects: Any = None
    ) -> None:
        self.programs = programs(robot, effects, models=models)
        self._functions = {name: function_of(program) for name, program in self.programs.items()}

    def batch(self, name: str, *inputs: np.ndarray) -> tuple[tuple[np.ndarray, ...], np.ndarray]:
        """Run one model, sample after sample."""
        rows = [self._functions[name].call(list(sample)) for sample in zip(*inputs, strict=True)]
        parts: list[Any] = [np.array([np.array(x).ravel() for x in part]) for part in zip(*rows, strict=True)]
        return tuple(parts[:-1]), parts[-1][:, 0]
