"""The inertial parameters of all bodies as arguments, for derivatives."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from ....structure.module import Module
from ....structure.robot import HybridRobot
from ..expressions import unpack
from .module_arguments import ModuleArguments
from .traced import Decision

#: Indices of (m, h, Ixx, Ixy, Ixz, Iyy, Iyz, Izz) in `pinocchio.Inertia.toDynamicParameters`.
AS_PINOCCHIO = np.array([0, 1, 2, 3, 4, 5, 7, 6, 8, 9])


@dataclass(frozen=True)
class BodyInertias:
    """Ten inertial parameters of each body of a robot as arguments; equal modules share their code."""

    robot: HybridRobot

    @property
    def size(self) -> int:
        """Number of arguments."""
        return 10 * len(self.robot.bodies.bodies)

    @property
    def decisions(self) -> tuple[Decision, ...]:
        """Comparisons of arguments that decided the structure: none."""
        return ()

    @cached_property
    def of_modules(self) -> tuple[ModuleArguments, ...]:
        """Arguments of each module."""
        symbols = {
            id(module.mechanism): ca.SX.sym("parameters", 10 * len(module.mechanism.spec.tree))
            for module in self.robot.modules
        }
        return tuple(self._of(module, symbols[id(module.mechanism)]) for module in self.robot.modules)

    def _of(self, module: Module, column: ca.SX) -> ModuleArguments:
        """Return the arguments of a module: ten numbers of the bodies of its tree after the cuts."""
        spec = module.mechanism.spec
        bodies = [self.robot.body_of_joint[module.joints[body - 1]] for body in spec.tree_body[1:]]
        index = np.concatenate([10 * body + AS_PINOCCHIO for body in bodies])
        return ModuleArguments(column, index, spec, tuple(unpack(column).reshape(-1, 10)), False)
