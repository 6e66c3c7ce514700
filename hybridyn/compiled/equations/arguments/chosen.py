"""Numbers of a robot's description that are arguments of its models."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from ....structure.parameters.slots import Slot
from ....structure.robot import HybridRobot
from ..expressions import Expression, unpack
from ..rigid import ten_expressions
from .module_arguments import ModuleArguments
from .numbers_of import depends, numbers_of
from .traced import Decision, Expressed, expressed


@dataclass(frozen=True)
class ChosenNumbers:
    """Chosen numbers of a robot's description as arguments of its models."""

    robot: HybridRobot
    slots: tuple[Slot, ...]

    @property
    def size(self) -> int:
        """Number of arguments."""
        return len(self.slots)

    @property
    def decisions(self) -> tuple[Decision, ...]:
        """Comparisons of arguments that decided the structure."""
        return self.traced.decisions

    @cached_property
    def column(self) -> ca.SX:
        """Symbols of the numbers."""
        return ca.SX.sym("parameters", len(self.slots))

    @cached_property
    def traced(self) -> Expressed:
        """The modules' numbers as functions of them."""
        return expressed(self.robot, self.slots, unpack(self.column).tolist())

    @cached_property
    def places(self) -> dict[str, tuple[int, Expression, Expression]]:
        """Frames of the links in their bodies as functions of them (`Bodies.place`)."""
        return {link: numbers_of(at) for link, at in self.traced.place.items()}

    @cached_property
    def of_modules(self) -> tuple[ModuleArguments | None, ...]:
        """Arguments of each module; None for modules of constants alone."""
        return tuple(self._of(k) for k in range(len(self.robot.modules)))

    def _of(self, k: int) -> ModuleArguments | None:
        """Return the arguments of module k, or None."""
        spec = numbers_of(self.traced.specs[k])
        if not depends(spec):
            return None
        outputs = dict(zip(spec.outputs, spec.outputs_inertia, strict=True))
        bodies = [body or outputs[i] for i, body in enumerate(spec.leg_bodies, 1)]
        own = tuple(ten_expressions(body) for body in bodies)
        return ModuleArguments(self.column, np.arange(len(self.slots)), spec, own, True)
