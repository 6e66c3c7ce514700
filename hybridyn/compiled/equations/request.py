"""A robot and its effects as numbers, module by module, and the options of each module's code."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ...effects.choice import Choice, Effects, choose, without_losses
from ...effects.link_effect import LinkEffect
from ...effects.links import GroundContact
from ...errors import ModelError
from ...spatial import Array, Index
from ...structure.module import Module
from ...structure.parameters.slots import Slot
from ...structure.robot import HybridRobot
from ...symbols import Expression
from .acting import Acting, acting_on, refuse_beyond
from .arguments import ChosenNumbers, Inertias, ModuleArguments
from .coefficients import friction_slots
from .expressions import settled
from .module_plan import ModulePlan
from .parts import Parts, parts_of
from .planning import plan_module
from .rigid import ten_expressions, ten_numbers
from .rubbing_joints import rubbing_marks
from .states import check_shared_loads, generic_positions

#: Why a force that follows links is refused where modules are differentiated one by one.
FOLLOWS_LINKS = (
    "derivatives of 'ddm' and over motors go module by module, and this force follows links of several "
    "modules; the models and the derivatives of 'idm' over joints have it"
)


@dataclass(frozen=True)
class Request:
    """A robot and the effects to compile.

    Attributes:
        arguments: Numbers that are inputs of the model ("parameters"), or None.
        dtype: Type of the arithmetic, "float64" or "float32"; it decides how far loops may be open.
        compared: Whether guards compare both ends of each loop (`scales.Scale`).
        links: Links on which the caller gives wrenches, the input "wrenches" of the models of forces.
    """

    robot: HybridRobot
    on: Effects
    arguments: ChosenNumbers | Inertias | None = None
    dtype: str = "float64"
    compared: bool = True
    links: tuple[str, ...] = ()

    @cached_property
    def given_wrenches(self) -> list[Acting]:
        """Where the wrenches of the caller enter."""
        return [self._placed(link) for link in self.links]

    @cached_property
    def contacts(self) -> list[tuple[Acting, LinkEffect]]:
        """Where wrenches that depend on the motion of links enter, and their laws; none on a base at rest."""
        place, still = self.robot.bodies.place, self.robot.base != "floating"
        return [
            (self._placed(link), law)
            for law in self.on.of_motion
            for link in law.links
            if isinstance(law, GroundContact) or not (still and place[link][0] == 0)
        ]

    def _placed(self, link: str) -> Acting:
        """Return where a wrench on a link enters.

        Raises:
            ModelError: It is no part of an output.
        """
        found = acting_on(self.robot, link)
        _, R, p = self.places[link]
        return found._replace(R=R, p=p)

    @property
    def places(self) -> Mapping[str, tuple[int, Expression, Expression]]:
        """Frames of the links in their bodies, `Bodies.place`, as functions of arguments."""
        chosen = self.arguments
        return chosen.places if isinstance(chosen, ChosenNumbers) else self.robot.bodies.place

    def weight(self, link: str) -> tuple[Any, Expression]:
        """Return mass and centre of mass of a link, as functions of arguments."""
        if isinstance(self.arguments, ChosenNumbers):
            return self.arguments.weights[link]
        return next((x.mass, x.com) for x in self.robot.description.links if x.name == link)

    @property
    def wrench_inputs(self) -> list[tuple[str, int]]:
        """The last input "wrenches" of models of forces and its size, or nothing."""
        return [("wrenches", 6 * len(self.links))] if self.links else []

    def carries(self, k: int) -> tuple[bool, ...]:
        """Return for each output of module k whether a module stands on it or a wrench acts on it."""
        acting = [*self.given_wrenches, *(at for at, _ in self.contacts)]
        pushed = {at.output for at in acting if at.module == k}
        outputs = range(len(self.robot.modules[k].mechanism.spec.outputs))
        return tuple(bool(self.children(k, o)) or o in pushed for o in outputs)

    @cached_property
    def plans(self) -> list[ModulePlan]:
        """A plan for each module, with its arguments."""
        plans = list(self.constant_plans)
        if isinstance(self.arguments, ChosenNumbers):
            for k in reversed(range(len(plans))):  # what a module moves down comes before what carries it
                plans[k] = self._with_arguments(k, plans, self.arguments)
        return plans

    def _with_arguments(self, k: int, plans: list[ModulePlan], chosen: ChosenNumbers) -> ModulePlan:
        """Return the plan of module k with its arguments and those of the modules that it carries.

        Pivots and groups of legs are those of the constants.
        """
        module, own = self.robot.modules[k], chosen.of_modules[k]
        spec = module.mechanism.spec if own is None else own.spec
        moved_down = self._moved_down(k, plans)
        if own is None and all(base.dtype != object for bases in moved_down for base in bases):
            return replace(plans[k], column=chosen.column) if self._argued(module) else plans[k]
        inertias = tuple(
            settled(sum(bases, ten_expressions(body)))
            for body, bases in zip(spec.outputs_inertia, moved_down, strict=True)
        )
        plan = replace(plans[k], inertias=inertias, column=chosen.column)
        if own is None:
            return plan
        return replace(plan, parts=self._parts(module, own))

    def _parts(self, module: Module, arguments: ModuleArguments | None) -> Parts:
        """Split a module into its core and its groups of legs."""
        return parts_of(
            module.mechanism,
            self.marks(module),
            leg_inertia=self.on.leg_inertia is not None,
            arguments=arguments,
            rubbing=self.rubs(module),
        )

    def rubs(self, module: Module) -> dict[int, str]:
        """Return a mark for each joint of a module that load makes rub, by its number in the whole tree."""
        return {} if self.on.loaded is None else rubbing_marks(self.on.loaded, module)

    def _argued(self, module: Module) -> bool:
        """Return whether a coefficient of load friction of a module is an argument."""
        own = (slot for joint in module.joints for slot in friction_slots(self.on.loaded, joint))
        return not set(self.slots).isdisjoint(own)

    @cached_property
    def undriven(self) -> list[bool]:
        """Whether each module, or one below it, has fewer motors that move than motions."""
        out: list[bool] = []
        for module, plan in zip(self.robot.modules, self.plans, strict=True):
            motions = module.mobility - len(plan.parts.all_idle)
            below = module.parent >= 0 and out[module.parent]
            out.append(below or len(module.moving_motors) < motions)
        return out

    @cached_property
    def constant_plans(self) -> list[ModulePlan]:
        """A plan for each module, which chooses its pivots; equal modules with equal marks share it."""
        known: dict[tuple[object, ...], ModulePlan] = {}
        out = []
        given = self.arguments
        inertias = None if given is None or isinstance(given, ChosenNumbers) else given.of_modules
        for k, module in enumerate(self.robot.modules):
            key = (id(module.mechanism), self.marks(module), *self.rubs(module).items())
            if key not in known:
                own = None if inertias is None else inertias[k]
                parts = self._parts(module, own)
                plan = plan_module(parts, generic_positions(module), self.dtype, compared=self.compared)
                if own is not None:
                    outputs = tuple(own.own[o - 1] for o in own.spec.outputs)
                    plan = replace(plan, inertias=outputs, column=own.column)
                known[key] = plan
            out.append(known[key])
        return out

    def parameter_index(self, k: int) -> Index:
        """Return the places of the arguments of module k in the input "parameters"."""
        assert self.arguments is not None
        own = self.arguments.of_modules[k]
        return np.arange(self.arguments.size) if own is None else own.index

    @property
    def slots(self) -> tuple[Slot, ...]:
        """Numbers of the description that are arguments."""
        return self.arguments.slots if isinstance(self.arguments, ChosenNumbers) else ()

    @property
    def parameter_inputs(self) -> list[tuple[str, int]]:
        """The input "parameters" of programs and its size, or nothing."""
        return [] if self.arguments is None else [("parameters", self.arguments.size)]

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
        for n, at in enumerate([*self.given_wrenches, *(at for at, _ in self.contacts)]):
            for column in at.path if self.robot.modules[at.module] is module else ():
                out[column] += f"law of wrench {n} "
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
        moved_down = self._moved_down(k, self.constant_plans)
        bodies = self.robot.modules[k].mechanism.spec.outputs_inertia
        totals = [ten_numbers(x) + sum(y, np.zeros(10)) for x, y in zip(bodies, moved_down, strict=True)]
        return tuple(tuple(total.tolist()) for total in totals)

    def _moved_down(self, k: int, plans: list[ModulePlan]) -> list[list[Expression]]:
        """Return for each output of module k the ten numbers that the modules on it move to it."""
        outputs = range(len(self.robot.modules[k].mechanism.spec.outputs))
        return [[plans[i].parts.base for i in self.children(k, o)] for o in outputs]

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
    wrenches: Sequence[str] = (),
    contacts: bool = False,
) -> Request:
    """Check that a model with these effects can be compiled, and return the request for it.

    Args:
        wrenches: Links on which the caller gives wrenches.
        contacts: Whether the models may have forces that follow the motion of links.

    Raises:
        ModelError: An effect is not available in compiled models, or no wrench can act on a link.
    """
    on = without_losses(choose(robot, effects), "compiled models do not take", compiled=True)
    for unit in (*on.links, *((on.base,) if on.base else ())):
        follows = isinstance(unit, LinkEffect) and unit.of_motion
        if contacts and follows:
            continue
        why = FOLLOWS_LINKS if follows else "it depends on time"
        raise ModelError(
            f"the effect '{unit.name}' cannot be compiled: {why}. Use the general path for it",
            element=unit.name,
        )
    if on.loaded is not None:
        acting = [*wrenches, *(link for unit in on.links for link in unit.links)]
        refuse_beyond(robot, on.loaded, [link for link in acting if _moves(robot, link)])
    if on.inertia is None:
        raise ModelError("models without the effect 'inertia' cannot be compiled", element="inertia")
    if on.loaded is not None:
        check_shared_loads(robot, on)
    chosen = ChosenNumbers(robot, tuple(parameters)) if parameters else None
    return Request(robot, on, chosen, dtype, links=tuple(wrenches))


def _moves(robot: HybridRobot, link: str) -> bool:
    """Return whether a link is no part of a base at rest."""
    return robot.base == "floating" or link not in robot.bodies.place or robot.bodies.place[link][0] > 0
