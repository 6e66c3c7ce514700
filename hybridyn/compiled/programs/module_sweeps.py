"""What the sweeps of the inverse and of the direct model share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from ...effects.joints import OnJoints
from ...effects.tendons import OnTendons
from ...spatial import Index
from ...structure.module import Module
from ..equations.arguments import ChosenNumbers
from ..equations.coefficients import slots_of
from ..equations.expressions import pack
from ..equations.request import Request
from ..program import Constants, Shared, Source
from .acting import ActingWrenches
from .gears import lossy, write_passed_on
from .module_calls import ModuleCalls, Stages, moving_base
from .on_symbols import written_effort
from .writer import Writer


class Sweeps:
    """Add the calls of the modules to a program, sweep by sweep.

    Attributes:
        request: The robot and its effects.
        w: The program under construction.
        root: Places of the motion of a moving base.
    """

    def __init__(
        self,
        request: Request,
        writer: Writer,
        acceleration: str,
        *,
        motors: bool = True,
        pushed: bool = False,
    ) -> None:
        """Begin with a moving base.

        Args:
            request: The robot and its effects.
            writer: The program under construction.
            acceleration: As for `moving_base`.
            motors: Whether motor efforts are user inputs ("tau"). The inverse model uses the laws alone.
            pushed: Whether "tau" begins with a wrench on a floating base.
        """
        self.request, self.w, self.motors, self.pushed = request, writer, motors, pushed
        self.root = moving_base(request, writer, acceleration)
        self.acting = ActingWrenches(request, writer)

    def push(self, modules: Sequence[ModuleCalls], port: str) -> None:
        """Take the wrenches on outputs from what these require: "F" of the inverse model, else "beta"."""
        copy = ca.SX.sym("wrench", 6)
        for k, output, place in self.acting.required:
            kernel = self.w.kernel("push", ca.Function("push", [copy], [copy]), "effects")
            self.w.call(kernel, 1, [place], [modules[k].ports[f"{port} {output}"]])

    def begun(
        self, k: int, modules: list[ModuleCalls], options: Any, written: Any, key: Any, parts: list[str]
    ) -> ModuleCalls:
        """Return the still empty calls of module k, after those of some modules; `key` is its code's."""
        parent, stages = self.request.robot.modules[k].parent, Stages(self.w, key, written.stages, parts)
        below = modules[parent] if parent >= 0 else None
        return ModuleCalls(self.request, self.w, k, options, written, stages, below, {**self.root})

    def efforts(self, k: int, columns: Index) -> Source:
        """Return the source of efforts on freedoms of module k's cut tree, shape (copies, entries)."""
        if self.pushed and k == 0:
            return self.w.from_given("tau", columns)
        module = self.request.robot.modules[k]
        marks = self.request.marks(module)
        if self.motors and all(marks[int(c)] == "motor " for c in columns.ravel()):
            return self._motors_of(module, columns)
        place = self.w.each(*columns.shape)
        for at, column in enumerate(columns.ravel().tolist(), place.start):
            self._sum(module, column, marks[column], Shared(at, 1), self.acting.along.get((k, column), []))
        return place

    def _motors_of(self, module: Module, columns: Index) -> Source:
        """Return the source of motor efforts, behind the gears, shape (copies, entries)."""
        numbers = dict(zip(module.motor_columns, module.motor_index, strict=True))
        motors = np.array([numbers[c] for c in columns.ravel()], dtype=int).reshape(columns.shape)
        given, gears = self.w.from_given("tau", 6 * self.pushed + motors), self.request.on.gears
        if gears is None or not lossy(gears, motors):
            return given
        return write_passed_on(self.request, self.w, gears, motors, given)

    def _sum(self, module: Module, column: int, mark: str, place: Shared, more: list[Shared]) -> None:
        """Add the call that computes the sum of motor effort, laws, and `more` efforts on one freedom."""
        request, w = self.request, self.w
        numbers = np.arange(1, request.robot.nv + 1, dtype=float)
        own = module.mechanism.cut.to_tree(numbers[None, module.v_index])
        at = int(own[0, column]) - 1
        inputs: list[ca.SX] = []
        sources: list[Source] = []
        total: Any = ca.SX(0.0)
        if self.motors and "motor" in mark:
            total = ca.SX.sym("tau")
            inputs, sources = [total], [self._motors_of(module, np.array([[column]]))]
        for other in more:
            inputs, sources = [*inputs, ca.SX.sym("more")], [*sources, other]
            total = total + inputs[-1]
        key: tuple[Any, ...] = ("effort", self.motors, mark, len(more))
        for law in request.on.joints:
            for i in np.flatnonzero(law.columns == at).tolist():
                coefficients = self._coefficients(law, i)
                p = ca.SX.sym("p", len(law.p))
                at_q, at_v = law.reads(i)
                x, v = ca.SX.sym("x", len(at_q)), ca.SX.sym("v", len(at_v))
                inputs += [*ca.vertsplit(p), x, v] if len(coefficients) > 1 else [p, x, v]
                sources += [*coefficients, w.from_given("q", at_q), w.from_given("v", at_v)]
                total = total + written_effort(law, i, p, x, v)
                key = (*key, x.numel(), v.numel(), repr(law.effect.name), len(law.p), len(coefficients))
        kernel = w.kernel(key, ca.Function("effort", inputs, [pack([total])]), "effects")
        w.call(kernel, 1, sources, [place])

    def _coefficients(self, law: OnJoints | OnTendons, i: int) -> list[Source]:
        """Return the sources of a law's coefficients: one for all, or one for each with arguments."""
        chosen = self.request.arguments
        values = np.array([[row[i] for row in law.p]])
        slots = slots_of(self.request.robot, law, i)
        if not isinstance(chosen, ChosenNumbers) or not set(slots) & set(chosen.slots):
            return [Constants(values)]
        return [
            self.w.from_given("parameters", np.array([chosen.slots.index(slot)]))
            if slot in chosen.slots
            else Constants(values[:, n : n + 1])
            for n, slot in enumerate(slots)
        ]
