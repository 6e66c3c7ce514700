"""Numbers of a robot that are arguments of its models, and the modules' numbers as functions of them.

They are chosen numbers of the description, or the inertias of bodies.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cached_property
from typing import Any, Protocol

import casadi as ca
import numpy as np

from ....spatial import Index
from ....structure.module_spec import ModuleSpec
from ....structure.parameters.slots import Slot
from ....structure.robot import HybridRobot
from ..expressions import Expression, unpack
from ..rigid import ten_expressions
from .traced import Decision, Expressed, Traced, expressed


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


def numbers_of(value: Any) -> Any:
    """Return a record with its traced numbers as expressions.

    Args:
        value: A record, a tuple, an array or a number, whose parts may be `Traced` with CasADi expressions.
            Arrays without any become plain numbers.
    """
    if isinstance(value, Traced):
        expression = ca.SX(value.expression)
        return float(expression) if expression.is_constant() else expression
    if is_dataclass(value) and not isinstance(value, type):
        return replace(value, **{x.name: numbers_of(getattr(value, x.name)) for x in fields(value)})
    if isinstance(value, tuple):
        parts = map(numbers_of, value)
        return value._make(parts) if hasattr(value, "_make") else tuple(parts)
    if not isinstance(value, np.ndarray) or value.dtype != object:
        return value
    out = np.empty(value.shape, dtype=object)
    for at in np.ndindex(*value.shape):
        out[at] = numbers_of(value[at])
    return out if any(isinstance(x, ca.SX) for x in out.ravel()) else out.astype(float)


def depends(value: Any) -> bool:
    """Return whether some number of a record is an expression."""
    return any(
        isinstance(x, ca.SX) or (isinstance(x, np.ndarray) and x.dtype.hasobject) for x in _parts(value)
    )


def _parts(value: Any) -> Iterator[Any]:
    """Yield the numbers, arrays and words of a record."""
    if is_dataclass(value):
        value = tuple(getattr(value, x.name) for x in fields(value))
    if not isinstance(value, tuple):
        yield value
        return
    for part in value:
        yield from _parts(part)


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
