"""Program of a robot's inverse model: one sweep over the modules outwards, one inwards."""

from __future__ import annotations

import numpy as np

from ...spatial import Index
from ..equations.balance import write_balance_stages
from ..equations.guarded_elimination import Pivots
from ..equations.inverse import write_inverse
from ..equations.inverse_legs import LEG_WRENCHES, write_inverse_legs
from ..equations.motor_balance import motor_pivots
from ..equations.options import Options, balance_options, inverse_options
from ..equations.request import Request
from ..equations.rubbing_joints import of_legs
from ..program import Program
from .gears import lossy, write_needed
from .kinematics import unit_base
from .module_calls import ModuleCalls, Ports, Stages, same_structure
from .module_sweeps import Sweeps
from .writer import Writer

PARTS = ["kinematics", "efforts"]


def inverse_program(request: Request, *, pushed: bool = False) -> Program:
    """Build the program of a robot's inverse model.

    Args:
        pushed: Whether "tau" begins with the wrench that a floating base needs, which nothing else exerts.
    """
    efforts = 6 * pushed + len(request.robot.motors)
    w = Writer("idm_pushed" if pushed else "idm", inverse_inputs(request), [("tau", efforts)])
    write_inverse_sweeps(request, w, pushed=pushed)
    return w.program()


def rubbing_program(request: Request) -> Program:
    """Build the program "idm_rubbing" of an inverse model that tells its friction that grows with load, too.

    Output "friction" has that of each joint of the law, in its order.
    """
    assert request.on.loaded is not None
    outputs = [("tau", len(request.robot.motors)), ("friction", len(request.on.loaded.joints))]
    w = Writer("idm_rubbing", inverse_inputs(request), outputs)
    write_inverse_sweeps(request, w)
    return w.program()


def inverse_inputs(request: Request) -> list[tuple[str, int]]:
    """Return name and length of each input of the inverse model."""
    robot = request.robot
    return [
        ("q", robot.nq),
        ("v", robot.nv),
        ("a", robot.nv),
        *request.parameter_inputs,
        *request.wrench_inputs,
    ]


def write_inverse_sweeps(request: Request, w: Writer, *, pushed: bool = False) -> None:
    """Add the sweeps of the inverse model to a program; `pushed` as for `inverse_program`."""
    unit_base(request, w)
    same_structure(request, w)
    _write_sweeps(request, w, pushed=pushed)


def write_balance(request: Request, w: Writer) -> list[ModuleCalls]:
    """Add the sweeps that compute what is left of the forces along each module's motions, zero for `ddm`.

    The inputs are those of the direct model, and its accelerations. What is left is the port "Q"; the
    accelerations along the motions are the port "u_dot".
    """
    return _write_sweeps(request, w, balance=True)


def _write_sweeps(
    request: Request, w: Writer, *, balance: bool = False, pushed: bool = False
) -> list[ModuleCalls]:
    """Add the sweeps; with `balance` (see `write_balance`), motor efforts are inputs."""
    sweeps = _InverseSweeps(request, w, "a", motors=balance, pushed=pushed)
    modules: list[ModuleCalls] = []
    for k in range(len(request.robot.modules)):
        start = len(w.steps)
        modules.append(sweeps.outwards(k, modules))
        modules[k].calls += w.calls_from(start)
    sweeps.push(modules, "F")
    for calls in reversed(modules):
        start = len(w.steps)
        sweeps.inwards(calls)
        held = calls.ports.get("held")  # of which there are no derivatives
        calls.calls += [call for call in w.calls_from(start) if held is None or held not in call.targets]
    return modules


class _InverseSweeps(Sweeps):
    """Add the calls of the modules to the program; with `motors` those of the balance."""

    def outwards(self, k: int, modules: list[ModuleCalls]) -> ModuleCalls:
        """Add the motion outwards, and the legs' forces."""
        w, calls = self.w, self._calls(k, modules)
        if self._balanced(k):
            calls.allocate_motions()
        for o in np.flatnonzero(calls.options.carries).tolist():
            calls.ports[f"F {o}"] = w.start(w.shared(6), np.zeros(6))
            if calls.options.measures:
                calls.ports[f"size {o}"] = w.start(w.shared(1), np.zeros(1))
        calls.call(0)
        calls.start_sums(LEG_WRENCHES)
        for n in range(len(calls.groups)):
            self._legs_outwards(calls, n)
        return calls

    def inwards(self, calls: ModuleCalls) -> None:
        """Add the efforts inwards."""
        if len(laws := calls.written.at["laws"]):
            calls.ports["laws"] = self.efforts(calls.k, laws[None])
        if self.pushed and calls.k == 0:
            calls.ports["Q of core"] = self.w.result("tau", np.arange(6))
        if not self._balanced(calls.k):
            self._drive(calls)
            return
        for s in range(1, len(calls.written.stages)):
            calls.call(s)

    def _balanced(self, k: int) -> bool:
        """Return whether nothing drives module k: what is left of its forces is asked for."""
        return self.motors or (self.pushed and k == 0)

    def _drive(self, calls: ModuleCalls) -> None:
        """Add the efforts of a module's motors, and frictions where these are a result."""
        if calls.options.rubbing and "friction" in self.w.results:
            calls.ports["n"] = self.w.result("friction", self._rubbing_of(calls))
        motors, gears = calls.module.motor_index, self.request.on.gears
        result = self.w.result("tau", 6 * self.pushed + motors)
        if gears is None or not lossy(gears, motors):
            calls.ports["tau"] = result
            calls.call(1)
            return
        joint_side = calls.ports["tau"] = self.w.shared(len(motors))
        calls.call(1)
        write_needed(self.request, self.w, gears, motors, joint_side, result)

    def _rubbing_of(self, calls: ModuleCalls) -> Index:
        """Return the numbers of a module's joints that rub among those of the law."""
        law, module = self.request.on.loaded, calls.module
        names = dict(zip(module.mechanism.spec.in_whole, module.joints, strict=True))
        return np.array([law.joints.index(names[one.joint]) for one in calls.options.rubbing] if law else [])

    def _calls(self, k: int, modules: list[ModuleCalls]) -> ModuleCalls:
        """Return the still empty calls of module k; equal modules share their code."""
        balance, plan = self._balanced(k), self.request.plans[k]
        options = balance_options(self.request, k) if balance else inverse_options(self.request, k)
        key = ("idm", id(plan), options, balance)
        if balance:
            written = self.w.once(key, write_balance_stages, plan, options)
        else:
            pivots, frictions = self._motor_pivots(k, options), "friction" in self.w.results
            written = self.w.once(key, write_inverse, plan, options, pivots, frictions=frictions)
        return self.begun(k, modules, options, written, key, [PARTS[0], *PARTS[1:] * 3])

    def _motor_pivots(self, k: int, options: Options) -> Pivots | None:
        """Return the pivots of the motor map of module k; equal modules share them."""
        plan, motors = self.request.constant_plans[k], tuple(options.motors[i] for i in options.moving)
        module = self.request.robot.modules[k]
        return self.w.once(("pivots", id(plan), motors), motor_pivots, plan, module, motors)

    def _legs_outwards(self, calls: ModuleCalls, n: int) -> None:
        """Add the forces of a group of legs, summed by platform."""
        plan, options, group = self.request.plans[calls.k], calls.options, calls.groups[n]
        lawful, driven = group[0].among(options.laws), group[0].among(options.motors)
        rubbing = tuple(of_legs(options.rubbing, plan.parts)[n])
        more_of = options.velocity, options.rotor, tuple(lawful), tuple(driven), rubbing
        key = ("idm of legs", id(plan), n, options.base, *more_of)
        stages, table = self.w.once(key, write_inverse_legs, plan, n, options, motions=self.motors)
        more: Ports = {"numbers": self.w.numbers(table, plan.column)}
        more |= calls.idle_ports(n) if self.motors else {}
        if lawful:
            more["laws"] = self.efforts(calls.k, np.array([leg.tree_v[lawful] for leg in group]))
        for name in ("motors", "rubbing"):
            if name in stages[0].outputs:
                more[name] = calls.of_each_leg(n, name, stages[0])
        calls.call_legs(group, Stages(self.w, key, stages, ["legs"], len(group)), 0, more)
