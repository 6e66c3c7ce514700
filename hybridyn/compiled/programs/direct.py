"""Program of a robot's direct model: three sweeps over its modules."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..equations.direct import write_direct
from ..equations.direct_legs import LEG_SUMS, write_direct_legs
from ..equations.expressions import plain, upper
from ..equations.leg_groups import Leg
from ..equations.options import direct_options
from ..equations.request import Request
from ..equations.rigid import inertia_matrix
from ..equations.rubbing_joints import of_legs
from ..program import Program, Source
from .kinematics import unit_base
from .module_calls import ModuleCalls, Ports, Stages, same_structure
from .module_sweeps import Sweeps
from .rubbing import settle_frictions
from .writer import Writer

PARTS = ["kinematics", "inertia", "accelerations", "wrists"]
LOADED = ["kinematics", "inertia", "accelerations", "accelerations", "wrists"]
LEG_PARTS = ["legs", "legs' accelerations"]


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
    return inputs + request.parameter_inputs + request.wrench_inputs


def write_direct_sweeps(request: Request, w: Writer, *, pushed: bool = False) -> None:
    """Add the sweeps of the direct model to a program; `pushed` as for `direct_program`."""
    robot = request.robot
    unit_base(request, w)
    same_structure(request, w)
    sweeps = _DirectSweeps(request, w, "base_acceleration", pushed=pushed)
    modules: list[ModuleCalls] = []
    for k in range(len(robot.modules)):
        modules.append(sweeps.outwards(k, modules))
    sweeps.push(modules, "beta")
    for calls in reversed(modules):
        sweeps.inwards(calls)
    if request.on.loaded is not None:
        for calls in modules:
            calls.call(2)
        settle_frictions(request, w, modules)
    for calls in modules:
        sweeps.accelerate(calls)


class _DirectSweeps(Sweeps):
    """Add the calls of the modules to the program, sweep by sweep."""

    def outwards(self, k: int, modules: list[ModuleCalls]) -> ModuleCalls:
        """Add the motion outwards: platforms, twists, and the legs' inertias and biases."""
        w, calls = self.w, self._calls(k, modules)
        for o in np.flatnonzero(calls.options.carries).tolist():
            own = upper(inertia_matrix(plain(calls.options.inertias[o]))).astype(float)
            constant = self.request.plans[k].inertias is None  # else it is added as an argument
            calls.ports[f"I {o}"] = w.start(w.shared(21), own if constant else np.zeros(21))
            calls.ports[f"beta {o}"] = w.start(w.shared(6), np.zeros(6))
        calls.call(0)
        calls.start_sums(LEG_SUMS)
        calls.legs = [self._legs_outwards(calls, n) for n in range(len(calls.groups))]
        return calls

    def inwards(self, calls: ModuleCalls) -> None:
        """Add the articulated inertias inwards."""
        if len(tau := calls.written.at["tau"]):
            calls.ports["tau"] = self.efforts(calls.k, tau[None])
        calls.call(1)

    def accelerate(self, calls: ModuleCalls) -> None:
        """Add the accelerations outwards: the core, the legs, the wrists."""
        v_index = calls.module.v_index
        for name in ("a_core", "a_legs", "a_wrists"):
            calls.ports[name] = self.w.result("a", v_index[calls.written.at[name]])
        back = 3 if calls.options.loaded else 2
        calls.call(back)
        for group, legs, numbers in calls.legs:
            at = v_index[np.array([leg.v for leg in group])]
            calls.call_legs(group, legs, 1, {"numbers": numbers, "a": self.w.result("a", at)})
        calls.call(back + 1)

    def _calls(self, k: int, modules: list[ModuleCalls]) -> ModuleCalls:
        """Return the still empty calls of module k; equal modules share their code."""
        plan, options = self.request.plans[k], direct_options(self.request, k)
        if self.pushed and k == 0:
            options = replace(options, motors=tuple(range(6)))
        key = ("ddm", id(plan), options)
        written = self.w.once(key, write_direct, plan, options)
        parts = LOADED if options.loaded else PARTS
        return self.begun(k, modules, options, written, key, parts)

    def _legs_outwards(self, calls: ModuleCalls, n: int) -> tuple[tuple[Leg, ...], Stages, Source]:
        """Add the inertias and biases of a group of legs, summed by platform; return it and its numbers."""
        plan, options, group = self.request.plans[calls.k], calls.options, calls.groups[n]
        key = (
            "ddm of legs",
            id(plan),
            n,
            options.base is None,
            options.velocity,
            options.rotor,
            tuple(of_legs(options.rubbing, plan.parts)[n]),
        )
        stages, table = self.w.once(key, write_direct_legs, plan, n, options)
        numbers = self.w.numbers(table, plan.column)
        legs = Stages(self.w, key, stages, LEG_PARTS, len(group))
        more: Ports = {"numbers": numbers}
        if "rubbing" in stages[0].outputs:
            more["rubbing"] = calls.of_each_leg(n, "rubbing", stages[0])
        if forced := group[0].among(options.motors):
            more["tau"] = self.efforts(calls.k, np.array([leg.tree_v[forced] for leg in group]))
        calls.call_legs(group, legs, 0, more)
        return group, legs, numbers
