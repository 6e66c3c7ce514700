"""A robot and its effects as numbers, module by module, and the options of each module's code."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import pinocchio as pin

from ...assembly.free_motions import MASSLESS_MOTION, own_inertia
from ...dynamics.actuation import load_share
from ...effects.catalogue import OF_MOTION, OfMotion
from ...effects.choice import Choice, Effects, choose
from ...effects.links import GroundContact
from ...errors import ActuationError, ModelError
from ...spatial import Array, Index
from ...structure.module import Module
from ...structure.parameters.slots import Slot
from ...structure.robot import HybridRobot
from .acting import Acting, acting_on
from .arguments import ChosenNumbers, Inertias, ModuleArguments
from .core import ModulePlan, path_of, plan_module
from .expressions import Expression, settled
from .parts import Parts, parts_of
from .rigid import ten_expressions, ten_numbers
from .spins import ROUNDED_SPIN
from .states import generic_positions


@dataclass(frozen=True)
class Request:
    """A robot and the effects to compile.

    Attributes:
        arguments: Numbers that are inputs of the model ("parameters"), or None.
        dtype: Type of the arithmetic, "float64" or "float32"; it decides how far loops may be open.
        compared: Whether guards compare both ends of each loop (`guarded_elimination.Scale`).
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
    def contacts(self) -> list[tuple[Acting, OfMotion]]:
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
    def undriven(self) -> list[bool]:
        """Whether each module, or one below it, has fewer motors that move than motions."""
        out: list[bool] = []
        for module, plan in zip(self.robot.modules, self.plans, strict=True):
            motions = module.mobility - len(plan.parts.idle)
            below = module.parent >= 0 and out[module.parent]
            out.append(below or len(module.moving_motors) < motions)
        return out

    @cached_property
    def constant_plans(self) -> list[ModulePlan]:
        """A plan for each module, which chooses its pivots; equal modules with equal marks share it."""
        known: dict[tuple[int, tuple[str, ...]], ModulePlan] = {}
        out = []
        given = self.arguments
        inertias = None if given is None or isinstance(given, ChosenNumbers) else given.of_modules
        for k, module in enumerate(self.robot.modules):
            key = (id(module.mechanism), self.marks(module))
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
    on = choose(robot, effects)
    for unit in (*on.links, *((on.base,) if on.base else ())):
        if contacts and isinstance(unit, OF_MOTION):
            continue
        why = "it depends on time"
        if isinstance(unit, OF_MOTION):
            why = (
                "derivatives of 'ddm' and over motors go module by module, and this force follows links of "
                "several modules; the models and the derivatives of 'idm' over joints have it"
            )
        raise ModelError(
            f"the effect '{unit.name}' cannot be compiled: {why}. Use the general path for it",
            element=unit.name,
        )
    if on.inertia is None:
        raise ModelError("models without the effect 'inertia' cannot be compiled", element="inertia")
    chosen = ChosenNumbers(robot, tuple(parameters)) if parameters else None
    return Request(robot, on, chosen, dtype, links=tuple(wrenches))


@dataclass(frozen=True)
class Options:
    """Options of the code of one module's model; freedoms are those of the tree after the cuts.

    Attributes:
        base: The constant acceleration (less gravity) of a base at rest, else None.
        carries: Whether another module stands on each output, or a wrench acts on it.
        inertias: Ten numbers of each output, including those that regrouping moves to it.
        velocity: Whether velocity terms are on.
        rotor: Rotor inertias over the freedoms.
        motors: Freedoms on which an effort acts; of the inverse model those that are driven, in the order of
            the module's motors.
        moving: Indices of the motors that the closures let move.
        share: Share of the load of each moving motor if they are redundant, else empty.
        laws: Freedoms with joint laws, of the inverse model.
        measures: Whether the forces along motions without a motor, of this module or of one below it, are
            compared with the size of all their terms, also of those of the modules above.
        measured: Whether a module below it does.
        massless: Whether some motion of the module has no inertia; the general path then computes it.
        usual: Largest inertia that each freedom moves with all other joints locked, for the direct model of a
            module without loops that carries others; else empty.
    """

    base: tuple[float, ...] | None
    carries: tuple[bool, ...]
    inertias: tuple[tuple[float, ...], ...]
    velocity: bool
    rotor: tuple[float, ...]
    motors: tuple[int, ...] = ()
    moving: tuple[int, ...] = ()
    share: tuple[float, ...] = ()
    laws: tuple[int, ...] = ()
    measures: bool = False
    measured: bool = False
    massless: bool = False
    usual: tuple[float, ...] = ()


def direct_options(request: Request, k: int) -> Options:
    """Return the options of the direct model of module k."""
    return replace(
        _of_all(request, k),
        motors=_forced(request, k),
        massless=_massless(request, k),
        usual=_usual(request, k),
    )


#: Inertia along a motion over that of all joints that is rounding of the motion itself, squared.
ROUNDED_MOTION = 1e-24


def _massless(request: Request, k: int) -> bool:
    """Return whether a motion of module k has no inertia; modules on an output add inertia to its motions.

    Pivots at the level of rounding cannot show this, since their diagonal entries are at that level too.
    """
    m = request.robot.modules[k].mechanism
    if not m.closures.rows or not m.mobility or request.on.leg_inertia is None:
        return False
    motion, rotor = m.tree.sweep(m.postures[:1]), np.array(request.rotor(request.robot.modules[k]))
    Psi = m.basis(m.closures.matrix(motion)).Psi[0]
    motions = np.linalg.qr(Psi / m.reduction.col_scale[:, None])[0]
    thin = _thin(request, k) / m.reduction.col_scale[:, None]
    if thin.size:
        motions = np.linalg.svd(motions - thin @ (thin.T @ motions))[0][:, : m.mobility - thin.shape[1]]
    motions = motions * m.reduction.col_scale[:, None]
    inertia = own_inertia(m, motions) + motions.T @ (rotor[:, None] * motions)
    for o, body in enumerate(m.spec.outputs):
        if request.children(k, o):
            a_map = m.jacobian(motion, body)[0] @ motions
            inertia = inertia + max(float(np.trace(inertia)), 1.0) * a_map.T @ a_map
    values = np.linalg.eigvalsh(inertia)
    free = own_inertia(m, np.diag(m.reduction.col_scale)) + np.diag(rotor * m.reduction.col_scale**2)
    return bool(values[0] <= max(MASSLESS_MOTION * values[-1], ROUNDED_MOTION * float(np.trace(free))))


def _thin(request: Request, k: int) -> Array:
    """Return the spins of module k without inertia, as motions of the tree after the cuts, shape (n, spins).

    Those of the file decide, also where arguments change them.
    """
    m, spins = request.plans[k].mechanism, request.plans[k].parts.idle
    rotor, turned = np.array(request.rotor(request.robot.modules[k])), m.turned_inertia
    M = m.legs.crba(m.postures[:1])[0, 6:, 6:] + np.diag(rotor)
    out: list[Array] = []
    for spin in spins:
        motion = np.zeros(m.tree.nv)
        motion[list(spin.cols)] = spin.axis
        reference = turned[list(spin.cols)].max() or turned.max() or 1.0
        if motion @ M @ motion <= ROUNDED_SPIN * request.plans[k].scale.eps * reference:
            out.append(motion)
    return np.array(out).reshape(len(out), m.tree.nv).T


def inverse_options(request: Request, k: int) -> Options:
    """Return the options of the inverse model of module k."""
    module = request.robot.modules[k]
    marks = request.marks(module)
    moving = module.moving_motors
    redundant = len(moving) > module.driven
    share = _share(request.robot, module) if redundant else np.zeros(0)
    return replace(
        _of_all(request, k),
        motors=tuple(int(c) for c in module.motor_columns),
        moving=tuple(moving.tolist()),
        share=tuple(share.tolist()),
        laws=tuple(i for i, mark in enumerate(marks) if "law" in mark),
        measures=request.undriven[k],
        measured=module.parent >= 0 and request.undriven[module.parent],
    )


def balance_options(request: Request, k: int) -> Options:
    """Return the options of the forces left in module k: all efforts are laws, and no motor is solved for."""
    return replace(_of_all(request, k), laws=_forced(request, k))


def _forced(request: Request, k: int) -> tuple[int, ...]:
    """Return the freedoms of module k on which a motor or a law acts."""
    return tuple(i for i, mark in enumerate(request.marks(request.robot.modules[k])) if mark)


def _of_all(request: Request, k: int) -> Options:
    """Return the options that the code of all models of module k depends on."""
    module = request.robot.modules[k]
    return Options(
        base=request.root(module),
        carries=request.carries(k),
        inertias=request.output_inertias(k),
        velocity=request.on.velocity is not None,
        rotor=request.rotor(module),
    )


def _usual(request: Request, k: int) -> tuple[float, ...]:
    """Return `Options.usual` of module k."""
    module = request.robot.modules[k]
    m = module.mechanism
    carries = any(request.children(k, o) for o in range(len(m.spec.outputs)))
    if len(m.closures.row_slices) or m.spec.wrists or not carries:
        return ()
    model, home, rng = request.robot.unchanged_model, request.robot.home, np.random.default_rng(0)
    data, nv = model.createData(), request.robot.nv
    postures = [home] + [pin.integrate(model, home, rng.normal(size=nv)) for _ in range(7)]
    locked = np.max([np.diag(pin.crba(model, data, q)) for q in postures], axis=0)
    return tuple(locked[module.v_index].tolist())


def _share(robot: HybridRobot, module: Module) -> Array:
    """Return the share of the load of each motor that can move; empty if the robot does not define it."""
    try:
        return load_share(robot, module, None)
    except ActuationError:
        return np.zeros(0)
