"""Efforts on joints: motor efforts given by the user, and joint laws."""

from __future__ import annotations

import warnings
from typing import Any

import casadi as ca
import numpy as np

from ...effects.joints import OnJoints
from ...errors import ModelError
from ...spatial import Index
from ..equations.arguments.coefficients import slots_of
from ..equations.arguments.module_arguments import ChosenNumbers
from ..equations.expressions import pack
from ..equations.request import Request
from ..program import Constants, Shared, Source
from .writer import Writer


class Efforts:
    """Provide the efforts on freedoms of a module as a source of a call."""

    def __init__(
        self, request: Request, writer: Writer, *, motors: bool = True, pushed: bool = False
    ) -> None:
        """Prepare the efforts of a program.

        Args:
            request: The robot and its effects.
            writer: The program under construction.
            motors: Whether motor efforts are user inputs ("tau"). The inverse model uses the laws alone.
            pushed: Whether "tau" begins with a wrench on a floating base.
        """
        self._request, self._writer, self._motors, self._pushed = request, writer, motors, pushed
        robot = request.robot
        self._motor_of = {}
        for module in robot.modules:
            for column, number in zip(module.motor_columns, module.motor_index, strict=True):
                self._motor_of[id(module), int(column)] = int(number)

    def of(self, k: int, columns: Index) -> Source:
        """Return the source of efforts on freedoms of module k's cut tree, shape (copies, entries)."""
        if self._pushed and k == 0:
            return self._writer.from_given("tau", columns)
        marks = self._request.marks(self._request.robot.modules[k])
        if self._motors and all(marks[int(c)] == "motor " for c in columns.ravel()):
            return self._writer.from_given("tau", self._motor_numbers(k, columns))
        copies, entries = columns.shape
        place = self._writer.each(copies, entries)
        for j in range(entries):
            self._laws(k, columns[:, j], place.start + j, entries)
        return place

    def _motor_numbers(self, k: int, columns: Index) -> Index:
        """Return the motors' indices in tau."""
        module = self._request.robot.modules[k]
        numbers = [6 * self._pushed + self._motor_of[id(module), int(c)] for c in columns.ravel()]
        return np.array(numbers, dtype=int).reshape(columns.shape)

    def _laws(self, k: int, columns: Index, start: int, stride: int) -> None:
        """Add calls that compute the sum of motor effort and laws, joint by joint."""
        request, w = self._request, self._writer
        module = request.robot.modules[k]
        mark = request.marks(module)[int(columns[0])]
        for i, column in enumerate(columns):
            inputs, sources, total, key = self._one(k, int(column), mark)
            function = ca.Function("effort", inputs, [pack([total])])
            kernel = w.kernel(("effort", key), function, "effects")
            w.call(kernel, 1, sources, [Shared(start + i * stride, 1)])

    def _one(self, k: int, column: int, mark: str) -> tuple[list[ca.SX], list[Source], Any, Any]:
        """Return the effort on one freedom: symbols, their sources, the sum, and a key of equal efforts."""
        request, w = self._request, self._writer
        module = request.robot.modules[k]
        numbers = np.arange(1, request.robot.nv + 1, dtype=float)
        own = module.mechanism.cut.to_tree(numbers[None, module.v_index])
        at = int(own[0, column]) - 1
        inputs: list[ca.SX] = []
        sources: list[Source] = []
        total: Any = ca.SX(0.0)
        if self._motors and "motor" in mark:
            tau = ca.SX.sym("tau")
            inputs, sources, total = (
                [tau],
                [w.from_given("tau", self._motor_numbers(k, np.array([column])))],
                tau,
            )
        key: tuple[Any, ...] = (self._motors, mark)
        for law in request.on.joints:
            here = np.flatnonzero(law.columns == at)
            if not len(here):
                continue
            i = int(here[0])
            coefficients = self._coefficients(law, i)
            pieces = [ca.SX.sym("p", size) for size, _ in coefficients]
            p = ca.vertcat(*pieces)
            turns = bool(law.turns[i])
            x = ca.SX.sym("x", 2 if turns else 1)
            v = ca.SX.sym("v")
            angle = ca.atan2(x[1], x[0]) if turns else x[0]
            effort = _written(law.effect, p, angle, v)
            q_at = int(law.at[i])
            inputs += [*pieces, x, v]
            sources += [
                *(source for _, source in coefficients),
                w.from_given("q", np.arange(q_at, q_at + x.numel())),
                w.from_given("v", np.array([at])),
            ]
            total = total + effort
            key = (*key, turns, repr(law.effect.name), len(pieces))
        return inputs, sources, total, key

    def _coefficients(self, law: OnJoints, i: int) -> list[tuple[int, Source]]:
        """Return the sources of a law's coefficients on its freedom i with their sizes.

        Constants come from one source. If some are arguments, each has its own.
        """
        arguments = self._request.arguments
        values = np.array([[row[i] for row in law.p]])
        if isinstance(arguments, ChosenNumbers):
            slots = slots_of(self._request.robot, law, i)
            at = [None if slot not in arguments.slots else arguments.slots.index(slot) for slot in slots]
            if any(place is not None for place in at):
                return [
                    (1, Constants(values[:, n : n + 1]))
                    if place is None
                    else (1, self._writer.from_given("parameters", np.array([place])))
                    for n, place in enumerate(at)
                ]
        return [(len(law.p), Constants(values))]


def _written(effect: Any, p: ca.SX, x: Any, v: ca.SX) -> Any:
    """Return a law's effort as an expression by running its NumPy code on symbols."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", FutureWarning)  # CasADi's, on NumPy functions of its symbols
            return effect.effort(tuple(p[n] for n in range(p.numel())), x, v)
    except (TypeError, AttributeError, ValueError, RuntimeError, NotImplementedError) as error:
        raise ModelError(
            f"the effect '{effect.name}' cannot be compiled: use the general path for it", element=effect.name
        ) from error
