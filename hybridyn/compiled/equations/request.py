"""Request for a compiled model: a robot and its effects as numbers, module by module."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...effects.choice import Choice, Effects, choose
from ...errors import ModelError
from ...spatial import Array, Index
from ...structure.module import Module
from ...structure.parameters.slots import Slot
from ...structure.robot import HybridRobot
from .arguments.module_arguments import ChosenNumbers, Inertias, ModuleArguments
from .core import Plan, plan_module
from .expressions import settled
from .parts import Parts, parts_of
from .paths import path_of
from .rigid import ten_expressions, ten_numbers
from .states import generic_positions


@dataclass(frozen=True)
class Request:
    """A robot and the effects to compile.

    Attributes:
        arguments: Numbers that are inputs of the model ("parameters"), or None.
        dtype: Type of the arithmetic, "float64" or "float32"; it decides how far loops may be open.
        compared: Whether guards compare both ends of each loop (`guards.Scale`).
    """

    robot: HybridRobot
    on: Effects
    arguments: ChosenNumbers | Inertias | None = None
    dtype: str = "float64"
    compared: bool = True

    @cached_property
    def plans(self) -> list[Plan]:
        """A plan for each module, with its arguments."""
        plans = list(self.constant_plans)
        if isinstance(self.arguments, ChosenNumbers):
            for k in reversed(range(len(plans))):  # what a module moves down comes before what carries it
                plans[k] = self._with_arguments(k, plans, self.arguments)
        return plans

    def _with_arguments(self, k: int, plans: list[Plan], chosen: ChosenNumbers) -> Plan:
        """Return the plan of module k with its arguments and those of the modules that it carries.

        Pivots and groups of legs are those of the constants.
        """
        module, own = self.robot.modules[k], chosen.of_modules[k]
        spec = module.mechanism.spec if own is None else own.spec
        moved_down = [[plans[i].parts.base for i in self.children(k, o)] for o in range(len(spec.outputs))]
        if own is None and all(base.dtype != object for bases in moved_down for base in bases):
            return plans[k]
        inertias = tuple(
            settled(sum(bases, ten_expressions(body)))
            for body, bases in zip(spec.outputs_inertia, moved_down, strict=True)
        )
        plan = replace(plans[k], inertias=inertias, column=chosen.column)
        if own is None:
            return plan
        paths = tuple(path_of(module.mechanism, spec, wrist) for wrist in spec.wrists)
        return replace(plan, parts=self._parts(module, own), paths=paths)

    def _parts(self, module: Module, arguments: ModuleArguments | None) -> Parts:
        """Split a module into its core and its groups of legs."""
        return parts_of(
            module.mechanism,
            self.marks(module),
            leg_inertia=self.on.leg_inertia is not None,
            arguments=arguments,
        )

    @cached_property
    def constant_plans(self) -> list[Plan]:
        """A plan for each module, which chooses its pivots; equal modules with equal marks share it."""
        known: dict[tuple[int, tuple[str, ...]], Plan] = {}
        out = []
        given = self.arguments
        inertias = None if given is None or isinstance(given, ChosenNumbers) else given.of_modules
        for k, module in enumerate(self.robot.modules):
            key = (id(module.mechanism), self.marks(module))
            if key not in known:
                own = None if inertias is None else inertias[k]
                positions = self.positions(module)
                plan = plan_module(self._parts(module, own), positions, self.dtype, compared=self.compared)
                if own is not None:
                    outputs = tuple(own.own[o - 1] for o in own.spec.outputs)
                    plan = replace(plan, inertias=outputs, column=own.column)
                known[key] = plan
            out.append(known[key])
        return out

    def positions(self, module: Module) -> Array:
        """Return generic assembled positions of a module's spanning tree, shape (samples, nq)."""
        key = id(module.mechanism)
        if key not in self._positions:
            self._positions[key] = generic_positions(module)
        return self._positions[key]

    def parameter_index(self, k: int) -> Index:
        """Return the places of the arguments of module k in the input "parameters"."""
        assert self.arguments is not None
        own = self.arguments.of_modules[k]
        return np.arange(self.arguments.size) if own is None else own.index

    @property
    def parameter_inputs(self) -> list[tuple[str, int]]:
        """The input "parameters" of programs and its size, or nothing."""
        return [] if self.arguments is None else [("parameters", self.arguments.size)]

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
            own = m.cut.to_tree(on[None, module.v_index])
            for k in np.flatnonzero(own[0]):
                out[k] += f"law {n} "
        return tuple(out)

    def rotor(self, module: Module) -> tuple[float, ...]:
        """Return the rotor inertias on the diagonal of the mass matrix, over the tree after the cuts."""
        diagonal = self.on.rotor_diagonal(self.robot)
        return tuple(module.mechanism.cut.to_tree(diagonal[None, module.v_index])[0].tolist())

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
                (self.constant_plans[i].parts.base for i in self.children(k, o)), np.zeros(10)
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
    parameters: Sequence[Slot] = (),
    dtype: str = "float64",
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
    return Request(robot, on, ChosenNumbers(robot, tuple(parameters)) if parameters else None, dtype)
