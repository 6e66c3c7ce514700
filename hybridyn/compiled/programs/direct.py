"""Program of a robot's direct model: three sweeps over its modules."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ...spatial import Array
from ..equations.direct import LEG_SUMS, DirectModule, write_direct, write_direct_legs
from ..equations.expressions import plain, upper
from ..equations.parts import Leg
from ..equations.request import DirectOptions, Request, direct_options
from ..equations.rigid import inertia_matrix
from ..equations.stages import Stage, twist_width
from ..program import Add, Call, Program, Shared, Source, Target, Worst
from .module_calls import Efforts, ModuleCalls, Stages, moving_base, read, same_structure, unit_base
from .writer import Writer

PARTS = ["kinematics", "inertia", "accelerations", "wrists"]
LEG_PARTS = ["legs", "legs' accelerations"]


@dataclass
class DirectCalls(ModuleCalls):
    """Calls of one module in the direct model.

    Attributes:
        articulated: Articulated inertia and bias of its outputs that carry modules, by output.
        legs: Its groups of legs, with their calls and their own numbers.
        efforts: Source of its efforts; empty without any.
        deltas: Acceleration of each platform relative to the base, by the platform's link of the core.
        u_dot: Accelerations along its motions, where they are asked for.
        leg_calls: Calls of its legs: their contributions, then their accelerations.
    """

    options: DirectOptions
    written: DirectModule
    below: DirectCalls | None
    articulated: dict[int, tuple[Add, Add]] = field(default_factory=dict)
    legs: list[tuple[tuple[Leg, ...], Stages, Source]] = field(default_factory=list)
    efforts: dict[str, Source] = field(default_factory=dict)
    deltas: dict[int, Shared] = field(default_factory=dict)
    u_dot: Shared | None = None
    leg_calls: list[Call] = field(default_factory=list)


def direct_program(request: Request, *, pushed: bool = False) -> Program:
    """Build the program of a robot's direct model.

    Args:
        pushed: Whether "tau" begins with a wrench on a floating base.
    """
    name = "ddm_pushed" if pushed else "ddm"
    w = Writer(name, direct_inputs(request, pushed=pushed), [("a", request.robot.nv)])
    write_direct_sweeps(request, w, pushed=pushed)
    return w.program()


def direct_inputs(request: Request, *, pushed: bool = False) -> list[tuple[str, int]]:
    """Return name and length of each input of the direct model; `pushed` as for `direct_program`."""
    robot = request.robot
    inputs = [("q", robot.nq), ("v", robot.nv), ("tau", 6 * pushed + len(robot.motors))]
    if robot.base == "moving":
        inputs.append(("base_acceleration", 6))
    return inputs + request.parameter_inputs


def write_direct_sweeps(
    request: Request, w: Writer, *, motions: bool = False, pushed: bool = False
) -> list[DirectCalls]:
    """Add the sweeps of the direct model to a program, and return the calls of each module.

    Args:
        request: The robot and its effects.
        w: The program under construction.
        motions: Whether the accelerations along the modules' motions are kept (`DirectCalls.u_dot`).
        pushed: As for `direct_program`.
    """
    robot = request.robot
    unit_base(request, w)
    same_structure(request, w)
    given = w.from_given("base_acceleration", np.arange(6)) if robot.base == "moving" else None
    root = moving_base(request, w, given, report=True) if given else None
    sweeps = _Sweeps(request, w, root, motions, pushed)
    modules: list[DirectCalls] = []
    for k in range(len(robot.modules)):
        modules.append(sweeps.outwards(k, modules))
    for calls in reversed(modules):
        sweeps.inwards(calls)
    for calls in modules:
        sweeps.accelerate(calls)
    return modules


class _Sweeps:
    """Add the calls of the modules to the program, sweep by sweep."""

    def __init__(
        self,
        request: Request,
        writer: Writer,
        root: tuple[Source, Source] | None,
        motions: bool,
        pushed: bool,
    ) -> None:
        self.request, self.w, self.root, self.motions, self.pushed = request, writer, root, motions, pushed
        self.efforts = Efforts(request, writer, pushed=pushed)
        self._code: dict[Any, DirectModule] = {}
        self._leg_code: dict[Any, tuple[list[Stage], Array]] = {}

    def outwards(self, k: int, modules: list[DirectCalls]) -> DirectCalls:
        """Add the motion outwards: platforms, twists, and the legs' inertias and biases."""
        w, calls = self.w, self._calls(k, modules)
        targets = calls.place_platforms(19)
        for o, carried in enumerate(calls.options.carries):
            if carried:
                calls.V[o] = w.shared(twist_width(calls.options.velocity))
                own, bias = w.start(w.shared(21), self._own(calls, o)), w.start(w.shared(6), np.zeros(6))
                calls.articulated[o] = own, bias
                targets |= {f"V {o}": calls.V[o], f"bias {o}": bias, f"own {o}": own}
        calls.stages.call(0, calls.sources(), targets)
        for i in sorted({group[0].platform for group in calls.groups}):  # sums in the order of the platforms
            calls.sums_of(i, LEG_SUMS)
        for n in range(len(calls.groups)):
            self._legs_outwards(calls, n)
        return calls

    def inwards(self, calls: DirectCalls) -> None:
        """Add the articulated inertias inwards."""
        sources = calls.sources() | calls.summed()
        for o, (inertia, bias) in calls.articulated.items():
            sources |= {f"I {o}": read(inertia), f"beta {o}": read(bias)}
        if len(calls.written.tau):
            calls.efforts = {"tau": self.efforts.of(calls.k, calls.written.tau[None])}
        sources |= calls.efforts
        targets: dict[str, Target] = {"guard": Worst()}
        if calls.below is not None:
            inertia, bias = calls.below.articulated[calls.module.parent_output]
            targets |= {"I_base": inertia, "b_base": bias}
        elif self.root is not None:
            targets |= {"I_base": self.w.shared(21), "b_base": self.w.shared(6)}
        calls.stages.call(1, sources, targets)

    def accelerate(self, calls: DirectCalls) -> None:
        """Add the accelerations outwards: the core, the legs, the wrists."""
        w, written, v_index = self.w, calls.written, calls.module.v_index
        calls.deltas = {i: w.shared(6) for i in written.platforms}
        calls.A = {o: w.shared(6) for o in calls.V}
        targets: dict[str, Target] = {f"delta {i}": place for i, place in calls.deltas.items()}
        targets |= {f"A {o}": place for o, place in calls.A.items()}
        if self.motions:
            calls.u_dot = w.shared(calls.module.mobility)
            targets["u_dot"] = calls.u_dot
        sources = calls.sources() | calls.efforts
        calls.stages.call(2, sources, targets | {"a_core": w.result("a", v_index[written.joints])})
        for group, legs, numbers in calls.legs:
            at = v_index[np.array([leg.v for leg in group])]
            delta = calls.deltas[group[0].platform]
            legs.call(1, {"numbers": numbers, "delta": delta}, {"a": w.result("a", at)})
            calls.leg_calls.append(w.last)
        sources["a_legs"] = w.result("a", v_index[written.legs])
        wrists = w.result("a", v_index[written.wrists])
        calls.stages.call(3, sources, {"a_wrists": wrists, "guard": Worst()})

    def _calls(self, k: int, modules: list[DirectCalls]) -> DirectCalls:
        """Return the still empty calls of module k; equal modules share their code."""
        plan, options = self.request.plans[k], direct_options(self.request, k)
        if self.pushed and k == 0:
            options = replace(options, motors=tuple(range(6)))
        key = (id(plan), options)
        if key not in self._code:
            name = f"module_{len(self._code)}"
            self._code[key] = write_direct(name, plan, options, motions=self.motions)
        written, parent = self._code[key], self.request.robot.modules[k].parent
        stages = Stages(self.w, key, written.stages, PARTS)
        below = modules[parent] if parent >= 0 else None
        return DirectCalls(self.request, self.w, k, options, written, stages, below, self.root)

    def _own(self, calls: DirectCalls, o: int) -> Array:
        """Return an output's own inertia, the start of its articulated inertia; zero if it is an argument."""
        if self.request.plans[calls.k].inertias is not None:
            return np.zeros(21)
        return upper(inertia_matrix(plain(calls.options.inertias[o]))).astype(float)

    def _legs_outwards(self, calls: DirectCalls, n: int) -> None:
        """Add the inertias and biases of a group of legs, summed by platform."""
        plan, options, group = self.request.plans[calls.k], calls.options, calls.groups[n]
        key = (id(plan), n, options.base is None, options.velocity, options.rotor)
        if key not in self._leg_code:
            self._leg_code[key] = write_direct_legs(plan, n, options)
        stages, table = self._leg_code[key]
        numbers = self.w.numbers(table, plan.column)
        legs = Stages(self.w, ("legs", key), stages, LEG_PARTS, len(group))
        sources, forced = calls.leg_sources(group, numbers), group[0].among(options.motors)
        if forced:
            sources["tau"] = self.efforts.of(calls.k, np.array([leg.tree_v[forced] for leg in group]))
        legs.call(0, sources, calls.sums_of(group[0].platform, LEG_SUMS))
        calls.leg_calls.append(self.w.last)
        calls.legs.append((group, legs, numbers))
