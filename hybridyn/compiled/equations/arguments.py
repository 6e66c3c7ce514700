"""Numbers of a robot that are arguments of its models, and the modules' numbers as functions of them.

They are chosen numbers of the description, or the inertias of bodies. A traced number has a value, which
decides comparisons, and an expression of any algebra. The code that turns a description into modules runs on
it as on floats; each comparison that depends on a parameter is recorded, because other values of the
parameters may decide it otherwise.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cached_property, partialmethod
from typing import Any, Protocol

import casadi as ca
import numpy as np

from ...spatial import Array, Index
from ...structure.graph import find_modules
from ...structure.module_spec import ModuleSpec, module_spec
from ...structure.parameters.slots import Slot, values_of, with_values
from ...structure.robot import HybridRobot
from ...symbols import Expression
from .expressions import filled, settled, unpack
from .rigid import ten_expressions


@dataclass(frozen=True)
class Decision:
    """A comparison that depends on parameters.

    Attributes:
        compare: The operator, such as `operator.lt`.
        left, right: Its sides, expressions or floats.
        outcome: Its result at the values of the parameters.
    """

    compare: Callable[[Any, Any], Any]
    left: Any
    right: Any
    outcome: bool


#: Guard where arguments decide the structure otherwise.
OTHER_STRUCTURE = 2.0


def decided_alike(decisions: Sequence[Decision]) -> ca.SX:
    """Return a guard above 1 where some comparison has another outcome than at the nominal arguments."""
    guard = ca.SX(0.0)
    for one in decisions:
        holds = one.compare(ca.SX(one.left), ca.SX(one.right))
        alike = holds if one.outcome else ca.logic_not(holds)
        guard = ca.fmax(guard, ca.if_else(alike, 0.0, OTHER_STRUCTURE))
    return guard


class Traced:
    """A number with its value and its expression.

    Attributes:
        expression: The expression; it supports the operators of arithmetic.
        record: The decisions of the trace, which grows.
    """

    __slots__ = ("expression", "record", "value")
    __hash__ = None  # type: ignore[assignment]

    def __init__(self, value: float, expression: Any, record: list[Decision]) -> None:
        self.value, self.expression, self.record = value, expression, record

    def _with(self, other: Any, apply: Callable[[Any, Any], Any]) -> Any:
        """Return the result of an operator; arrays apply it entry by entry."""
        if isinstance(other, np.ndarray):
            return NotImplemented
        value, expression = _both(other)
        return Traced(float(apply(self.value, value)), apply(self.expression, expression), self.record)

    def __add__(self, other: Any) -> Any:
        return self if _is(other, 0.0) else self._with(other, operator.add)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        return self if _is(other, 0.0) else self._with(other, operator.sub)

    def __rsub__(self, other: Any) -> Any:
        return -self if _is(other, 0.0) else self._with(other, lambda x, y: y - x)

    def __mul__(self, other: Any) -> Any:
        if _is(other, 0.0):
            return 0.0
        return self if _is(other, 1.0) else self._with(other, operator.mul)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Any:
        return self if _is(other, 1.0) else self._with(other, operator.truediv)

    def __rtruediv__(self, other: Any) -> Any:
        return 0.0 if _is(other, 0.0) else self._with(other, lambda x, y: y / x)

    def __neg__(self) -> Traced:
        return Traced(-self.value, -self.expression, self.record)

    def __abs__(self) -> Traced:
        return Traced(abs(self.value), abs(self.expression), self.record)

    def _compared(self, compare: Callable[[Any, Any], Any], other: Any) -> bool:
        """Compare by value and record the decision."""
        value, expression = _both(other)
        outcome = bool(compare(self.value, value))
        self.record.append(Decision(compare, self.expression, expression, outcome))
        return outcome

    __lt__ = partialmethod(_compared, operator.lt)
    __le__ = partialmethod(_compared, operator.le)
    __gt__ = partialmethod(_compared, operator.gt)
    __ge__ = partialmethod(_compared, operator.ge)
    __eq__ = partialmethod(_compared, operator.eq)
    __ne__ = partialmethod(_compared, operator.ne)

    def __bool__(self) -> bool:
        return self._compared(operator.ne, 0.0)

    def __float__(self) -> float:
        """Return the value, for scales and tolerances: what follows from it does not follow the parameter."""
        return self.value


def _is(x: Any, number: float) -> bool:
    """Return whether an operand is a certain plain number."""
    return not isinstance(x, (Traced, np.ndarray)) and bool(x == number)


def _both(x: Any) -> tuple[Any, Any]:
    """Return value and expression of an operand."""
    return (x.value, x.expression) if isinstance(x, Traced) else (x, x)


@dataclass(frozen=True, eq=False)
class Expressed:
    """A robot whose modules' numbers are traced.

    Attributes:
        specs: The numbers of each module of the robot; entries that depend on slots are `Traced`.
        place: `Bodies.place`, likewise.
        weights: Mass and centre of mass of each link, likewise.
        decisions: Comparisons of slots that decided the modules' structure.
    """

    specs: tuple[ModuleSpec, ...]
    place: dict[str, tuple[int, Array, Array]]
    weights: dict[str, tuple[Any, Array]]
    decisions: tuple[Decision, ...]


def expressed(robot: HybridRobot, slots: Sequence[Slot], symbols: Sequence[Any]) -> Expressed:
    """Compute the numbers of a robot's modules as functions of the numbers in slots.

    Args:
        robot: The robot; its values decide the structure.
    """
    record: list[Decision] = []
    values = values_of(robot.description, slots)
    traced = [Traced(value, symbol, record) for value, symbol in zip(values, symbols, strict=True)]
    description = with_values(robot.description, slots, traced)
    bodies, graphs = find_modules(description, robot.held)
    specs = []
    modules = list(robot.modules)
    if robot.base == "floating":
        spec = modules.pop(0).mechanism.spec
        body = replace(bodies.bodies[0], name="", joint=0, heaviest=0.0)  # as `ModuleSpec` has it
        specs.append(replace(spec, outputs_inertia=(body,)))
    for module, graph in zip(modules, graphs, strict=True):
        own = module.mechanism.spec
        spec = module_spec(bodies, graph, own.home)
        specs.append(spec if own.wrists else module_spec(bodies, graph, own.home, cut=False))
    weights = {link.name: (link.mass, link.com) for link in description.links}
    return Expressed(tuple(specs), bodies.place, weights, tuple(record))


@dataclass(frozen=True, eq=False)
class ModuleArguments:
    """The arguments of one module's code.

    Attributes:
        column: Their symbols.
        index: Their places in the input "parameters" of a program.
        spec: The module's numbers, which may be expressions.
        own: Ten inertial numbers of each body of the tree after the cuts, as expressions.
        free: Whether legs and base inertial parameters are those of the constants too. If not, no legs are
            grouped and nothing is regrouped.
    """

    column: ca.SX
    index: Index
    spec: ModuleSpec
    own: tuple[Expression, ...]
    free: bool


def numbers_of(value: Any, found: list[ca.SX]) -> Any:
    """Return a record with its traced numbers as expressions.

    Args:
        value: A record, a tuple, an array or a number, whose parts may be `Traced` with CasADi expressions.
            Arrays without any become plain numbers.
        found: The expressions that are not constant are appended.
    """
    if isinstance(value, Traced):
        expression = ca.SX(value.expression)
        found += [] if expression.is_constant() else [expression]
        return float(expression) if expression.is_constant() else expression
    if is_dataclass(value) and not isinstance(value, type):
        return replace(value, **{x.name: numbers_of(getattr(value, x.name), found) for x in fields(value)})
    if isinstance(value, tuple):
        parts = [numbers_of(x, found) for x in value]
        return value._make(parts) if hasattr(value, "_make") else tuple(parts)
    if not isinstance(value, np.ndarray) or value.dtype != object:
        return value
    return settled(filled([numbers_of(x, found) for x in value.ravel()], *value.shape))


class Inertias(Protocol):
    """Inertial numbers of the bodies as arguments; equal modules share their code and their symbols."""

    @property
    def size(self) -> int:
        """Number of arguments."""

    @property
    def of_modules(self) -> tuple[ModuleArguments, ...]:
        """Arguments of each module, which are not `free`."""


@dataclass(frozen=True)
class ChosenNumbers:
    """Chosen numbers of a robot's description as arguments of its models."""

    robot: HybridRobot
    slots: tuple[Slot, ...]

    @property
    def size(self) -> int:
        """Number of arguments."""
        return len(self.slots)

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
        return {link: numbers_of(at, []) for link, at in self.traced.place.items()}

    @cached_property
    def weights(self) -> dict[str, tuple[Any, Expression]]:
        """Mass and centre of mass of each link as functions of them."""
        return {link: numbers_of(weight, []) for link, weight in self.traced.weights.items()}

    @cached_property
    def of_modules(self) -> tuple[ModuleArguments | None, ...]:
        """Arguments of each module; None for modules of constants alone."""
        return tuple(self._of(k) for k in range(len(self.robot.modules)))

    def _of(self, k: int) -> ModuleArguments | None:
        """Return the arguments of module k, or None."""
        found: list[ca.SX] = []
        spec = numbers_of(self.traced.specs[k], found)
        if not found:
            return None
        outputs = dict(zip(spec.outputs, spec.outputs_inertia, strict=True))
        bodies = [body or outputs[i] for i, body in enumerate(spec.leg_bodies, 1)]
        own = tuple(ten_expressions(body) for body in bodies)
        return ModuleArguments(self.column, np.arange(len(self.slots)), spec, own, True)
