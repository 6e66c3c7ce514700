"""Columns of the regressor in C: the derivatives of the inverse model over the inertial numbers of bodies.

The efforts are linear in these numbers, so that the derivatives are the columns themselves, exactly. Equal
legs share the model's arguments: their derivatives are summed where they arise, and cost little.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import chain
from typing import Any

import casadi as ca
import numpy as np

from ..effects.choice import Effects
from ..spatial import Array, Index, Mask
from ..structure.module import Module
from ..structure.robot import HybridRobot
from .code.library_source import Source, library_source
from .code.rules import compacted
from .code.scalars import GUARD_LIMIT, Scalar
from .comparing import compare_at_states
from .equations.arguments import ModuleArguments
from .equations.expressions import unpack
from .equations.request import Request, request
from .failures import as_compile_error
from .library.artifact import Artifact
from .library.building import best_lanes
from .library.cache import Built
from .library.calls import Library
from .program import Constants, Program
from .programs.derivatives.columns import collect
from .programs.derivatives.nodes import nodes_of
from .programs.derivatives.sweeps import DENSE, ProgramGraph, Sweep
from .programs.inverse import inverse_inputs, write_inverse_sweeps
from .programs.sources import robot_key
from .programs.writer import Writer
from .verifying import movable_states

#: Largest difference from the general path at the states that a new library is compared at, relative to the
#: largest entry.
COLUMNS_AGREE = 1e-10
#: Name of the program.
NAME = "regressor"
#: Inertial numbers of a body.
OF_BODY = 10
#: Indices of (m, h, Ixx, Ixy, Ixz, Iyy, Iyz, Izz) in `pinocchio.Inertia.toDynamicParameters`.
AS_PINOCCHIO = np.array([0, 1, 2, 3, 4, 5, 7, 6, 8, 9])


@dataclass(frozen=True, eq=False)
class InertialNumbers:
    """The inertial numbers of bodies as arguments; bodies that share numbers share arguments.

    Attributes:
        robot: The robot.
        places: Bodies, and where their ten numbers are, as `pinocchio.Inertia.toDynamicParameters` has them;
            those of a body that is named twice are summed.
        size: Number of arguments; some need not be read.
    """

    robot: HybridRobot
    places: Sequence[tuple[int, Index]]
    size: int

    @cached_property
    def of_modules(self) -> tuple[ModuleArguments, ...]:
        """Arguments of each module."""
        symbols: dict[int, ca.SX] = {}
        return tuple(self._shared(module, symbols) for module in self.robot.modules)

    def _shared(self, module: Module, symbols: dict[int, ca.SX]) -> ModuleArguments:
        """Return the arguments of a module; those of equal modules have the same symbols."""
        spec = module.mechanism.spec
        bodies = [self.robot.body_of_joint[module.joints[body - 1]] for body in spec.tree_body[1:]]
        sums = [[at for loaded, at in self.places if loaded == body] for body in bodies]
        index = np.array(list(dict.fromkeys(chain.from_iterable(chain.from_iterable(sums)))), dtype=int)
        column = symbols.setdefault(id(module.mechanism), ca.SX.sym("parameters", len(index)))
        number = {int(place): i for i, place in enumerate(index)}
        entries = unpack(column)
        zero = np.array([ca.SX(0.0)] * OF_BODY, dtype=object)
        own = tuple(
            sum((entries[[number[int(i)] for i in at[AS_PINOCCHIO]]] for at in places), zero)
            for places in sums
        )
        return ModuleArguments(column, index, spec, own, False)


def regressor_program(asked: Request, columns: Index) -> Program:
    """Build the program of the columns "Y" of some numbers, row by row.

    The rows of each module's motors are followed outwards on their own: they depend on no module below it.

    Args:
        asked: The robot with `InertialNumbers`.
        columns: The numbers.
    """
    robot, count = asked.robot, len(columns)
    motors = len(robot.motors)
    w = Writer(NAME, inverse_inputs(asked), [("tau", motors), ("Y", motors * count)])
    write_inverse_sweeps(asked, w)
    nodes = nodes_of(w, w.calls_from(0))
    graph = ProgramGraph.between(
        nodes, [w.from_given("parameters", columns)], [w.result("tau", np.arange(motors))]
    )
    known: dict[Any, Any] = {}
    for module in robot.modules if count else ():
        rows = module.motor_index
        sweep = Sweep(w, len(rows), known, DENSE)
        sweep.seed(w.result("tau", rows), Constants(np.eye(len(rows))))
        sweep.through(graph, back=True)
        for first in range(0, count if len(rows) else 0, 10):
            at = np.arange(first, min(first + 10, count))
            numbers = w.from_given("parameters", columns[at]).numbers(0)
            collect(sweep, numbers, w.result("Y", rows[:, None] * count + at))
    return compacted(w.program())


class InertialColumns:
    """Some columns of the regressor of one robot, in C."""

    def __init__(
        self,
        robot: HybridRobot,
        places: Sequence[tuple[int, Index]],
        effects: Effects,
        columns: Index,
        general: Callable[[Array, Array, Array], Array],
        values: Array,
    ) -> None:
        """Load the library from the cache, or build it and compare it with the general path.

        Args:
            robot: The robot.
            places: Bodies, and where their numbers are, as for `InertialNumbers`.
            effects: Effects of which the efforts are linear in the numbers.
            columns: Numbers over which the efforts are differentiated, shape (k,).
            general: Computes the columns by the general path from q, v, a.
            values: Numbers at which the efforts are computed, shape (size,).

        Raises:
            CompileError: There is no compiler, or the columns differ from the general path's.
            ModelError: An effect is not available in compiled models.
        """
        self._numbers = InertialNumbers(robot, places, len(values))
        self._effects, self._columns = effects, columns
        self._general, self._values = general, values
        known = [(body, at.tolist()) for body, at in places]
        key = (NAME, robot_key(robot, effects), best_lanes(), columns.tolist(), known)
        with as_compile_error(robot):
            self._library = Artifact(robot, repr(key), self._source, self._accept).loaded(Library)

    def _source(self) -> Source:
        """Write the program."""
        asked = replace(request(self._numbers.robot, self._effects), arguments=self._numbers)
        return library_source([regressor_program(asked, self._columns)], Scalar("float64", best_lanes()))

    def _accept(self, built: Built) -> None:
        """Compare a new library with the general path.

        Raises:
            CompileError: They differ.
        """
        robot, library = self._numbers.robot, Library(built)

        def run(q: Array, v: Array, _: Array, a: Array) -> tuple[list[Array], Array]:
            """Run the program."""
            Y, guard = self._run(library, q, v, a)
            return [Y], guard

        def general(q: Array, v: Array, _: Array, a: Array) -> list[Array]:
            """Compute the columns by the general path."""
            return [self._general(q, v, a)]

        states = partial(movable_states, robot, self._effects)
        compare_at_states(robot, "regressor", run, general, COLUMNS_AGREE, states=states)

    def _run(self, library: Library, q: Array, v: Array, a: Array) -> tuple[Array, Array]:
        """Return the columns, shape (T, motors, k), and the guards, shape (T,)."""
        values = np.ascontiguousarray(np.broadcast_to(self._values, (len(q), len(self._values))))
        (_, Y), guard = library.batch(NAME, q, v, a, values)
        return Y.reshape(len(q), len(self._numbers.robot.motors), -1), guard

    def __call__(self, q: Array, v: Array, a: Array) -> tuple[Array, Mask]:
        """Compute the columns, shape (T, motors, k), and which samples can be trusted, shape (T,).

        Args:
            q: Positions, shape (T, nq).
            v: Rates, shape (T, nv).
            a: Accelerations, shape (T, nv).
        """
        Y, guard = self._run(self._library, q, v, a)
        return Y, np.asarray(guard <= GUARD_LIMIT)
