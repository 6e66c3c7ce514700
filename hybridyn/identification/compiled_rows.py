"""Columns of Y in C: the derivatives of the compiled inverse model over the parameters of bodies.

The efforts are linear in these parameters, so that the derivatives are Y itself, exactly. Equal legs share
the model's arguments: their derivatives are summed where they arise, and cost little.
"""

from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import chain
from typing import Any

import casadi as ca
import numpy as np

from ..compiled.code.library_source import Source, library_source
from ..compiled.code.rules import compacted
from ..compiled.code.scalars import GUARD_LIMIT, Scalar
from ..compiled.comparing import compare_at_states
from ..compiled.equations.arguments import ModuleArguments
from ..compiled.equations.expressions import unpack
from ..compiled.equations.request import Request, request
from ..compiled.failures import as_compile_error
from ..compiled.library.artifact import Artifact
from ..compiled.library.building import best_lanes
from ..compiled.library.cache import Built
from ..compiled.library.calls import Library
from ..compiled.program import Constants, Program
from ..compiled.programs.derivatives.columns import collect
from ..compiled.programs.derivatives.nodes import nodes_of
from ..compiled.programs.derivatives.sweeps import DENSE, ProgramGraph, Sweep
from ..compiled.programs.inverse import inverse_inputs, write_inverse_sweeps
from ..compiled.programs.sources import robot_key
from ..compiled.programs.writer import Writer
from ..compiled.verifying import movable_states
from ..effects.catalogue import DEFAULT
from ..errors import CompileError
from ..spatial import Array, Index
from ..structure.module import Module
from ..structure.robot import HybridRobot
from .inertial import OF_BODY
from .regressor import add_laws, effort_rows
from .standard import StandardParameters

#: Largest difference from the general path at the states that a new library is compared at, relative to the
#: largest entry.
AGREES = 1e-10
#: Name of the program.
NAME = "regressor"


#: Indices of (m, h, Ixx, Ixy, Ixz, Iyy, Iyz, Izz) in `pinocchio.Inertia.toDynamicParameters`.
AS_PINOCCHIO = np.array([0, 1, 2, 3, 4, 5, 7, 6, 8, 9])


@dataclass(frozen=True)
class SharedInertias:
    """The standard parameters of bodies as arguments; bodies that share parameters share arguments.

    Attributes:
        robot: The robot.
        parameters: Its standard parameters.
    """

    robot: HybridRobot
    parameters: StandardParameters

    @property
    def size(self) -> int:
        """Number of arguments: all standard parameters, also those of laws, which are not read."""
        return len(self.parameters.names)

    @cached_property
    def of_modules(self) -> tuple[ModuleArguments, ...]:
        """Arguments of each module."""
        symbols: dict[int, ca.SX] = {}
        return tuple(self._shared(module, symbols) for module in self.robot.modules)

    def _shared(self, module: Module, symbols: dict[int, ca.SX]) -> ModuleArguments:
        """Return the arguments of a module; those of equal modules have the same symbols."""
        spec, p = module.mechanism.spec, self.parameters
        bodies = [self.robot.body_of_joint[module.joints[body - 1]] for body in spec.tree_body[1:]]
        every = (*p.bodies.items(), *p.payloads)
        sums = [[at for loaded, at in every if loaded == body] for body in bodies]
        index = np.array(list(dict.fromkeys(chain.from_iterable(chain.from_iterable(sums)))), dtype=int)
        column = symbols.setdefault(id(module.mechanism), ca.SX.sym("parameters", len(index)))
        number = {int(place): i for i, place in enumerate(index)}
        entries = unpack(column)
        zero = np.array([ca.SX(0.0)] * len(OF_BODY), dtype=object)
        own = tuple(
            sum((entries[[number[int(i)] for i in at[AS_PINOCCHIO]]] for at in places), zero)
            for places in sums
        )
        return ModuleArguments(column, index, spec, own, False)


def regressor_program(asked: Request, columns: Index) -> Program:
    """Build the program of the columns "Y" of some parameters, row by row.

    The rows of each module's motors are followed outwards on their own: they depend on no module below it.

    Args:
        asked: The robot with `SharedInertias`.
        columns: The parameters.
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


class CompiledRows:
    """Some columns of Y of one robot, in C where the model can be trusted.

    Attributes:
        robot: The robot.
        parameters: Its standard parameters.
        columns: Parameters whose columns are computed.
    """

    def __init__(self, robot: HybridRobot, parameters: StandardParameters, columns: Index) -> None:
        """Load the library from the cache, or build it and compare it with the general path.

        Raises:
            CompileError: There is no compiler or no CasADi, or a law acts on a joint without a motor.
            ModelError: An effect is not available in compiled models.
        """
        self.robot, self.parameters, self.columns = robot, parameters, np.asarray(columns, dtype=int)
        self._inertial = np.flatnonzero(np.isin(self.columns, parameters.tens))
        driven = [m.mobility == len(m.motors) == len(m.moving_motors) for m in robot.modules]
        odd = {joint for term in parameters.terms for joint in term.joints}.difference(robot.motors)
        if parameters.terms and (odd or not all(driven)):
            raise CompileError("laws on joints without a motor have no columns in compiled regressors")
        on = parameters.effects.only(DEFAULT)
        bodies = [at.tolist() for at in parameters.bodies.values()]
        key = (NAME, robot_key(robot, on), best_lanes(), self.columns.tolist(), bodies)
        with as_compile_error(robot):
            self._library = Artifact(robot, repr(key), self._source, self._accept).loaded(Library)

    def _source(self) -> Source:
        """Write the program."""
        asked = request(self.robot, self.parameters.effects.only(DEFAULT))
        asked = replace(asked, arguments=SharedInertias(self.robot, self.parameters))
        program = regressor_program(asked, self.columns[self._inertial])
        return library_source([program], Scalar("float64", best_lanes()))

    def _accept(self, built: Built) -> None:
        """Compare a new library with the general path.

        Raises:
            CompileError: They differ.
        """
        library, columns = Library(built), self.columns[self._inertial]

        def run(q: Array, v: Array, _: Array, a: Array) -> tuple[list[Array], Array]:
            """Run the program."""
            Y, guard = self._run(library, q, v, a)
            return [Y], guard

        def general(q: Array, v: Array, _: Array, a: Array) -> list[Array]:
            """Compute the columns by the general path."""
            return [effort_rows(self.robot, self.parameters, q, v, a)[..., columns]]

        states = partial(movable_states, self.robot, self.parameters.effects.only(DEFAULT))
        compare_at_states(self.robot, "regressor", run, general, AGREES, states=states)

    def _run(self, library: Library, q: Array, v: Array, a: Array) -> tuple[Array, Array]:
        """Return the inertial columns, shape (T, motors, k), and the guards, shape (T,)."""
        values = np.broadcast_to(self.parameters.values, (len(q), len(self.parameters.values)))
        (_, Y), guard = library.batch(NAME, q, v, a, np.ascontiguousarray(values))
        return Y.reshape(len(q), len(self.robot.motors), -1), guard

    def __call__(self, q: Array, v: Array, a: Array) -> Array:
        """Compute the columns, shape (T, motors, k), from checked arrays, (T, nq), (T, nv) and (T, nv).

        Raises:
            AssemblyError, SingularityError: As `regressor`, for samples that the code hands over.
        """
        Y = np.zeros((len(q), len(self.robot.motors), len(self.columns)))
        Y[..., self._inertial], guard = self._run(self._library, q, v, a)
        add_laws(Y, self.robot, self.parameters, self.columns, q, v, a)
        doubtful = np.flatnonzero(~(guard <= GUARD_LIMIT))
        if len(doubtful):
            at = q[doubtful], v[doubtful], a[doubtful]
            Y[doubtful] = effort_rows(self.robot, self.parameters, *at)[..., self.columns]
        return Y
