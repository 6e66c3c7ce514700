"""Program of a robot's inverse model: one sweep over the modules outwards, one inwards."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...spatial import Array
from ..equations.actuation import motor_pivots
from ..equations.inverse import LEG_WRENCHES, InverseModule, write_inverse, write_inverse_legs
from ..equations.request import InverseOptions, Request, balance_options, inverse_options
from ..equations.stages import Stage, twist_width
from ..equations.static_elimination import Pivots
from ..program import Add, Call, Each, Program, Shared, Source, Target, Worst
from .module_calls import Efforts, ModuleCalls, Stages, moving_base, read, same_structure, unit_base
from .writer import Writer

PARTS = ["kinematics", "efforts"]


@dataclass
class InverseCalls(ModuleCalls):
    """Calls of one module in the inverse model.

    Attributes:
        received: Wrench that the modules on each output require, by output.
        motors: Wrenches along delta of unit motor efforts in its groups of legs, by group.
        calls: Its calls, in order.
        left: What is left of the forces along its motions, if `write_balance` writes the calls.
        u_dot: Accelerations along its motions, where `write_balance` is asked for them.
        F_base: Target of the wrench on its base; None on a fixed base.
    """

    options: InverseOptions
    written: InverseModule
    below: InverseCalls | None
    received: dict[int, Add] = field(default_factory=dict)
    motors: dict[int, Each] = field(default_factory=dict)
    calls: list[Call] = field(default_factory=list)
    left: Shared | None = None
    u_dot: Shared | None = None
    F_base: Target | None = None


def inverse_program(request: Request, *, pushed: bool = False) -> Program:
    """Build the program of a robot's inverse model.

    Args:
        pushed: Whether "tau" begins with the wrench that a floating base needs, which nothing else exerts.
    """
    efforts = 6 * pushed + len(request.robot.motors)
    w = Writer("idm_pushed" if pushed else "idm", inverse_inputs(request), [("tau", efforts)])
    write_inverse_sweeps(request, w, pushed=pushed)
    return w.program()


def inverse_inputs(request: Request) -> list[tuple[str, int]]:
    """Return name and length of each input of the inverse model."""
    robot = request.robot
    return [("q", robot.nq), ("v", robot.nv), ("a", robot.nv), *request.parameter_inputs]


def write_inverse_sweeps(request: Request, w: Writer, *, pushed: bool = False) -> None:
    """Add the sweeps of the inverse model to a program; `pushed` as for `inverse_program`."""
    unit_base(request, w)
    same_structure(request, w)
    _write_sweeps(request, w, None, pushed=pushed)


def write_balance(request: Request, w: Writer, *, motions: bool = False) -> list[InverseCalls]:
    """Add the sweeps that compute what is left of the forces along each module's motions, zero for `ddm`.

    The inputs are those of the direct model, and its accelerations.

    Args:
        request: The robot and its effects.
        w: The program under construction.
        motions: Whether the accelerations along the modules' motions are kept (`InverseCalls.u_dot`).
    """
    left = [w.shared(module.mobility) for module in request.robot.modules]
    return _write_sweeps(request, w, left, motions)


def _write_sweeps(
    request: Request,
    w: Writer,
    balance: list[Shared] | None,
    motions: bool = False,
    pushed: bool = False,
) -> list[InverseCalls]:
    """Add the sweeps; with `balance` (see `write_balance`), motor efforts are inputs."""
    root = moving_base(request, w, w.from_given("a", np.arange(6)), report=False)
    sweeps = _Sweeps(request, w, root, balance, motions, pushed)
    modules: list[InverseCalls] = []
    for k in range(len(request.robot.modules)):
        start = len(w.steps)
        modules.append(sweeps.outwards(k, modules))
        modules[k].calls += w.calls_from(start)
    for calls in reversed(modules):
        start = len(w.steps)
        sweeps.inwards(calls)
        calls.calls += w.calls_from(start)
    return modules


class _Sweeps:
    """Add the calls of the modules to the program, sweep by sweep."""

    def __init__(
        self,
        request: Request,
        writer: Writer,
        root: tuple[Source, Source] | None,
        balance: list[Shared] | None,
        motions: bool,
        pushed: bool,
    ) -> None:
        self.request, self.w, self.root, self.balance = request, writer, root, balance
        self.motions, self.pushed = motions, pushed
        self.efforts = Efforts(request, writer, motors=balance is not None)
        self._code: dict[Any, InverseModule] = {}
        self._leg_code: dict[Any, tuple[list[Stage], Array]] = {}
        self._pivots: dict[Any, Pivots | None] = {}

    def outwards(self, k: int, modules: list[InverseCalls]) -> InverseCalls:
        """Add the motion outwards, and the legs' forces."""
        w, calls = self.w, self._calls(k, modules)
        targets = calls.place_platforms(26)
        for o, carried in enumerate(calls.options.carries):
            if carried:
                calls.V[o], calls.A[o] = w.shared(twist_width(calls.options.velocity)), w.shared(6)
                calls.received[o] = w.start(w.shared(6), np.zeros(6))
                targets |= {f"V {o}": calls.V[o], f"A {o}": calls.A[o]}
        if self.motions:
            targets["u_dot"] = calls.u_dot = w.shared(calls.module.mobility)
        calls.stages.call(0, calls.sources(), targets)
        for n in range(len(calls.groups)):
            self._legs_outwards(calls, n)
        return calls

    def inwards(self, calls: InverseCalls) -> None:
        """Add the efforts inwards."""
        sources = calls.sources() | calls.summed()
        sources |= {f"F {o}": read(wrench) for o, wrench in calls.received.items()}
        for n, each in calls.motors.items():
            sources[f"motors {n}"] = Shared(each.start, each.size * len(calls.groups[n]))
        if len(calls.written.laws):
            sources["laws"] = self.efforts.of(calls.k, calls.written.laws[None])
        targets: dict[str, Target] = {"guard": Worst()}
        if self.balance is not None:
            calls.left = targets["Q"] = self.balance[calls.k]
        elif self.pushed and calls.k == 0:
            targets["Q"] = self.w.result("tau", np.arange(6))
        else:
            targets["tau"] = self.w.result("tau", 6 * self.pushed + calls.module.motor_index)
        if calls.below is not None:
            calls.F_base = targets["F_base"] = calls.below.received[calls.module.parent_output]
        elif self.root is not None:
            calls.F_base = targets["F_base"] = self.w.shared(6)
        calls.stages.call(1, sources, targets)

    def _calls(self, k: int, modules: list[InverseCalls]) -> InverseCalls:
        """Return the still empty calls of module k; equal modules share their code."""
        balance = self.balance is not None or (self.pushed and k == 0)
        plan = self.request.plans[k]
        options = balance_options(self.request, k) if balance else inverse_options(self.request, k)
        key = (id(plan), options, balance)
        if key not in self._code:
            pivots = None if balance else self._motor_pivots(k, options)
            name = f"module_{len(self._code)}"
            self._code[key] = write_inverse(
                name, plan, options, pivots, balance=balance, motions=self.motions
            )
        written, parent = self._code[key], self.request.robot.modules[k].parent
        stages = Stages(self.w, key, written.stages, PARTS)
        below = modules[parent] if parent >= 0 else None
        return InverseCalls(self.request, self.w, k, options, written, stages, below, self.root)

    def _motor_pivots(self, k: int, options: InverseOptions) -> Pivots | None:
        """Return the pivots of the motor map of module k; equal modules share them."""
        plan, motors = self.request.constant_plans[k], tuple(options.motors[i] for i in options.moving)
        key = (id(plan), motors)
        if key not in self._pivots:
            positions = self.request.positions(self.request.robot.modules[k])
            self._pivots[key] = motor_pivots(plan, positions, motors)
        return self._pivots[key]

    def _legs_outwards(self, calls: InverseCalls, n: int) -> None:
        """Add the forces of a group of legs, summed by platform."""
        plan, options, group = self.request.plans[calls.k], calls.options, calls.groups[n]
        lawful, driven = group[0].among(options.laws), group[0].among(options.motors)
        key = (id(plan), n, options.base, options.velocity, options.rotor, tuple(lawful), tuple(driven))
        if key not in self._leg_code:
            self._leg_code[key] = write_inverse_legs(plan, n, options)
        stages, numbers = self._leg_code[key]
        sources = calls.leg_sources(group, self.w.numbers(numbers, plan.column))
        if lawful:
            sources["laws"] = self.efforts.of(calls.k, np.array([leg.tree_v[lawful] for leg in group]))
        targets = calls.sums_of(group[0].platform, LEG_WRENCHES)
        if driven:
            calls.motors[n] = self.w.each(len(group), 6 * len(driven))
            targets["motors"] = calls.motors[n]
        Stages(self.w, ("legs", key), stages, ["legs"], len(group)).call(0, sources, targets)
