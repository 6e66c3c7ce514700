"""Request for a compiled model: a robot and its effects as numbers, module by module."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from ...effects.choice import Choice, Effects, choose
from ...errors import ModelError
from ...spatial import Array, Index
from ...structure.module import Module
from ...structure.robot import HybridRobot
from .core import Plan, plan_module
from .expressions import Expression, unpack
from .guards import GUARD_CLOSED
from .parts import parts_of
from .rigid import ten_numbers
from .states import generic_positions

#: Indices of (m, h, Ixx, Ixy, Ixz, Iyy, Iyz, Izz) in `pinocchio.Inertia.toDynamicParameters`.
AS_PINOCCHIO = np.array([0, 1, 2, 3, 4, 5, 7, 6, 8, 9])


@dataclass(frozen=True)
class Request:
    """A robot and the effects to compile.

    Attributes:
        robot: The robot.
        on: The effects.
        regroup: Whether base inertial parameters are used.
        align: Whether body axes are aligned with the joint axes.
        parameters: Whether the bodies' inertial parameters are inputs of the model.
        dtype: Type of the arithmetic, "float64" or "float32"; it decides how far loops may be open.
        counted: Whether the code states which operations belong to which part (`Kernel.shares`).
    """

    robot: HybridRobot
    on: Effects
    regroup: bool = True
    align: bool = True
    parameters: bool = False
    dtype: str = "float64"
    counted: bool = False

    @cached_property
    def plans(self) -> list[Plan]:
        """A plan for each module; modules of one mechanism with equal marks share it."""
        known: dict[tuple[int, tuple[str, ...]], Plan] = {}
        out = []
        for module in self.robot.modules:
            marks = self.marks(module)
            key = (id(module.mechanism), marks)
            if key not in known:
                parts = parts_of(
                    module.mechanism,
                    marks,
                    leg_inertia=self.on.leg_inertia is not None,
                    regroup=self.regroup,
                    align=self.align,
                    own=self._own(module) if self.parameters else None,
                )
                known[key] = plan_module(parts, self.positions(module), GUARD_CLOSED[self.dtype])
            out.append(known[key])
        return out

    def positions(self, module: Module) -> Array:
        """Return generic assembled positions of a module's spanning tree, shape (samples, nq)."""
        key = id(module.mechanism)
        if key not in self._positions:
            self._positions[key] = generic_positions(module)
        return self._positions[key]

    def _own(self, module: Module) -> tuple[Expression, ...]:
        """Return symbols for the ten numbers of each body of a module's tree after the cuts."""
        bodies = len(module.mechanism.spec.tree)
        entries = unpack(ca.SX.sym("parameters", 10 * bodies)).reshape(bodies, 10)
        return tuple(entries)

    def parameter_index(self, module: Module) -> Index:
        """Return the indices of the ten numbers of a module's bodies in the input "parameters"."""
        spec = module.mechanism.spec
        own = [self.robot.body_of_joint[module.joints[body - 1]] for body in spec.tree_body[1:]]
        return np.concatenate([10 * body + AS_PINOCCHIO for body in own])

    @cached_property
    def _positions(self) -> dict[int, Array]:
        return {}

    def marks(self, module: Module) -> tuple[str, ...]:
        """Return for each freedom of a module's tree after the cuts the motor and laws that act on it."""
        m = module.mechanism
        out = ["motor " if k in module.motor_columns else "" for k in range(m.tree.nv)]
        for n, law in enumerate(self.on.joints):
            on = np.zeros(self.robot.nv)
            on[law.columns] = 1.0
            own = np.zeros((1, m.tree.nv))
            m.cut.to_tree(on[None, module.v_index], own)
            for k in np.flatnonzero(own[0]):
                out[k] += f"law {n} "
        return tuple(out)

    def rotor(self, module: Module) -> tuple[float, ...]:
        """Return the rotor inertias on the diagonal of the mass matrix, over the tree after the cuts."""
        diagonal = self.on.rotor_diagonal(self.robot)
        own = np.zeros((1, module.mechanism.tree.nv))
        if diagonal is not None:
            module.mechanism.cut.to_tree(diagonal[None, module.v_index], own)
        return tuple(own[0].tolist())

    def children(self, k: int, output: int) -> list[int]:
        """Return the indices of the modules that stand on an output."""
        return [
            i
            for i, module in enumerate(self.robot.modules)
            if module.parent == k and module.parent_output == output
        ]

    def output_inertias(self, k: int) -> tuple[tuple[float, ...], ...]:
        """Return the ten numbers of each output of a module, including those moved down by regrouping."""
        out = []
        for o, body in enumerate(self.robot.modules[k].mechanism.spec.outputs_inertia):
            total = ten_numbers(body) + sum(
                (self.plans[i].parts.base for i in self.children(k, o)), np.zeros(10)
            )
            out.append(tuple(total.tolist()))
        return tuple(out)

    @property
    def gravity(self) -> Array:
        """Gravity, zero where it is off, shape (3,)."""
        return self.robot.gravity if self.on.gravity is not None else np.zeros(3)

    def root(self, module: Module) -> tuple[float, ...] | None:
        """Return the base's acceleration (less gravity) of a module on a base at rest, else None."""
        if module.parent >= 0 or self.robot.base == "moving":
            return None
        return (*(-self.gravity).tolist(), 0.0, 0.0, 0.0)


def request(
    robot: HybridRobot,
    effects: Choice,
    *,
    regroup: bool = True,
    align: bool = True,
    parameters: bool = False,
    dtype: str = "float64",
    counted: bool = False,
) -> Request:
    """Check that a model with these effects can be compiled, and return the request for it.

    Raises:
        ModelError: An effect is not available in compiled models.
    """
    on = choose(robot, effects)
    for unit in (*on.links, *((on.base,) if on.base else ())):
        raise ModelError(
            f"the effect '{unit.name}' cannot be compiled: it depends on time or on contact. Use the general "
            "path for it",
            element=unit.name,
        )
    if on.inertia is None:
        raise ModelError("models without the effect 'inertia' cannot be compiled", element="inertia")
    return Request(robot, on, regroup, align, parameters, dtype, counted)
