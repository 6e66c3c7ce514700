"""The inverse model of a whole robot as a program: one sweep outwards, one inwards."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

from ..actuation import Sharing, load_share
from ..errors import ActuationError
from ..module import Module
from ..robot import HybridRobot
from ..spatial import Array
from .choices import Request
from .core import Plan
from .direct import base_twist
from .efforts import Efforts
from .expressions import pack, symbols, zeros
from .inverse import InverseModule, InverseOptions, leg_forces, write_inverse
from .legs import PlatformMotion, write_leg
from .motor_pivots import motor_pivots
from .program import Add, Constants, Each, Program, Shared, Source, Target, Worst
from .roots import moving_base
from .slots import Writer
from .stages import Stages
from .staging import Stage, cut
from .static_elimination import Pivots

PARTS = ["kinematics", "efforts"]
SUMS = (("b_base", 6), ("b_delta", 6))


@dataclass
class _ModuleCalls:
    """One module in the program."""

    plan: Plan
    written: InverseModule
    stages: Stages
    V: dict[int, Shared] = field(default_factory=dict)
    A: dict[int, Shared] = field(default_factory=dict)
    received: dict[int, Add] = field(default_factory=dict)
    sums: dict[tuple[int, str], Add] = field(default_factory=dict)
    motors: dict[int, Each] = field(default_factory=dict)
    platforms: dict[int, Shared] = field(default_factory=dict)


def inverse_program(request: Request) -> Program:
    """Write the inverse model of a robot."""
    robot = request.robot
    inputs = [("q", robot.nq), ("v", robot.nv), ("a", robot.nv)]
    if request.parameters:
        inputs.append(("parameters", 10 * len(robot.bodies.bodies)))
    w = Writer("idm", inputs, [("tau", len(robot.motors))])
    root = moving_base(request, w, w.from_given("a", np.arange(6)), report=False) if robot.nv >= 6 else None
    builder = _Builder(request, w)
    modules: list[_ModuleCalls] = []
    for k in range(len(robot.modules)):
        modules.append(builder.outwards(k, modules, root))
    for k in reversed(range(len(modules))):
        builder.inwards(k, modules)
    return w.program()


class _Builder:
    """Writes the calls of one module after the other."""

    def __init__(self, request: Request, writer: Writer) -> None:
        self.request, self.w = request, writer
        self.efforts = Efforts(request, writer, motors=False)
        self._written: dict[Any, InverseModule] = {}
        self._legs: dict[Any, tuple[list[Stage], Any]] = {}
        self._pivots: dict[Any, Pivots] = {}

    def _options(self, k: int) -> InverseOptions:
        """Give the options of a module's code."""
        request, robot = self.request, self.request.robot
        module, plan = robot.modules[k], request.plans[k]
        marks = request.marks(module)
        redundant = len(module.motors) > module.mobility
        share = _share(robot, module) if redundant else np.zeros(0)
        return InverseOptions(
            base=request.root(module),
            carries=tuple(bool(request.children(k, o)) for o in range(len(module.mechanism.spec.outputs))),
            inertias=request.output_inertias(k),
            velocity=request.on.velocity is not None,
            rotor=request.rotor(module),
            motors=tuple(int(c) for c in module.motor_columns),
            share=tuple(share.tolist()),
            laws=tuple(int(c) for c in plan.parts.tree_v if "law" in marks[c]),
        )

    def outwards(
        self, k: int, modules: list[_ModuleCalls], root: tuple[Source, Source] | None
    ) -> _ModuleCalls:
        """Write motion outwards, and what the legs need."""
        request, w = self.request, self.w
        module, plan = request.robot.modules[k], request.plans[k]
        options = self._options(k)
        key = (id(plan), options)
        if key not in self._written:
            pivots = (id(plan), options.motors)
            if pivots not in self._pivots:
                self._pivots[pivots] = motor_pivots(plan, request.positions(module), options.motors)
            name = f"module_{len(self._written)}"
            self._written[key] = write_inverse(name, plan, options, self._pivots[pivots])
        written = self._written[key]
        calls = _ModuleCalls(plan, written, Stages(w, key, written.stages, PARTS))
        sources = self._sources(k, written)
        if module.parent >= 0:
            below = modules[module.parent]
            sources |= {"V_base": below.V[module.parent_output], "A_base": below.A[module.parent_output]}
        elif root is not None:
            sources |= {"V_base": root[0], "A_base": root[1]}
        calls.platforms = {i: w.shared(24) for i in written.platforms}
        targets: dict[str, Target] = {f"platform {i}": place for i, place in calls.platforms.items()}
        for o, carried in enumerate(options.carries):
            if carried:
                calls.V[o], calls.A[o] = w.shared(3 if options.velocity else 6), w.shared(6)
                calls.received[o] = w.start(w.shared(6), np.zeros(6))
                targets |= {f"V {o}": calls.V[o], f"A {o}": calls.A[o]}
        calls.stages.call(0, sources, targets)
        for n in range(len(plan.parts.groups)):
            self._group(k, n, calls, options, sources)
        return calls

    def _sources(self, k: int, written: InverseModule) -> dict[str, Source]:
        """Give the sources of positions, rates and accelerations."""
        w, module = self.w, self.request.robot.modules[k]
        sources: dict[str, Source] = {
            "q": w.from_given("q", module.q_index[written.q]),
            "v": w.from_given("v", module.v_index[written.v]),
            "a": w.from_given("a", module.v_index[written.v]),
        }
        if self.request.parameters:
            sources["parameters"] = w.from_given("parameters", self.request.parameter_index(module))
        return sources

    def _group(
        self, k: int, n: int, calls: _ModuleCalls, options: InverseOptions, sources: dict[str, Source],
    ) -> None:  # fmt: skip
        """Write what a group of legs needs, summed by platform."""
        w, module = self.w, self.request.robot.modules[k]
        group = calls.plan.parts.groups[n]
        i = group[0].platform
        marks = self.request.marks(module)
        lawful = [j for j, c in enumerate(group[0].tree_v) if "law" in marks[c]]
        driven = [j for j, c in enumerate(group[0].tree_v) if int(c) in options.motors]
        key = (id(calls.plan), n, options.base, options.velocity, options.rotor, tuple(lawful), tuple(driven))
        if key not in self._legs:
            self._legs[key] = _write_group(calls.plan, n, options, lawful, driven)
        stages, table = self._legs[key]
        given: dict[str, Source] = dict(sources)
        for name, index, which in (
            ("q", module.q_index, "q"),
            ("v", module.v_index, "v"),
            ("a", module.v_index, "v"),
        ):
            given[name] = w.from_given(name, index[np.array([getattr(leg, which) for leg in group])])
        given |= {"numbers": Constants(table), "platform": calls.platforms[i]}
        if lawful:
            given["laws"] = self.efforts.of(k, np.array([leg.tree_v[lawful] for leg in group]))
        out: dict[str, Target] = {"guard": Worst()}
        for name, size in SUMS:
            if (i, name) not in calls.sums:
                calls.sums[i, name] = w.start(w.shared(size), np.zeros(size))
            out[name] = calls.sums[i, name]
        if driven:
            calls.motors[n] = w.each(len(group), 6 * len(driven))
            out["motors"] = calls.motors[n]
        Stages(w, ("legs", key), stages, ["legs"], len(group)).call(0, given, out)

    def inwards(self, k: int, modules: list[_ModuleCalls]) -> None:
        """Write efforts inwards."""
        w, module, calls = self.w, self.request.robot.modules[k], modules[k]
        sources = self._sources(k, calls.written)
        sources |= {f"{name} {i}": Shared(place.start, place.size) for (i, name), place in calls.sums.items()}
        sources |= {f"F {o}": Shared(place.start, place.size) for o, place in calls.received.items()}
        for n, each in calls.motors.items():
            sources[f"motors {n}"] = Shared(each.start, each.size * len(calls.plan.parts.groups[n]))
        if len(calls.written.laws):
            sources["laws"] = self.efforts.of(k, calls.written.laws[None])
        targets: dict[str, Target] = {"guard": Worst(), "tau": w.result("tau", module.motor_index)}
        if module.parent >= 0:
            targets["F_base"] = modules[module.parent].received[module.parent_output]
        elif self.request.robot.base == "moving":
            targets["F_base"] = w.shared(6)
        calls.stages.call(1, sources, targets)


def _write_group(
    plan: Plan, n: int, options: InverseOptions, lawful: list[int], driven: list[int]
) -> tuple[list[Stage], Any]:
    """Write what a group of legs needs for a motion."""
    group = plan.parts.groups[n]
    leg = group[0]
    (q_col, q), (v_col, v), (a_col, a) = (
        symbols("q", len(leg.q)),
        symbols("v", len(leg.v)),
        symbols("a", len(leg.v)),
    )
    (V_col, V_base), (A_col, A_base) = base_twist(options.velocity), symbols("A_base", 6)
    inputs = {"q": q_col, "v": v_col, "a": a_col}
    if options.base is not None:
        V_base, A_base = zeros(6), np.array(options.base, dtype=float).astype(object)
    else:
        inputs |= {"V_base": V_col, "A_base": A_col}
    p_col, p = symbols("platform", 24)
    law_col, laws = symbols("laws", len(lawful))
    law = zeros(len(leg.v))
    law[lawful] = laws
    if lawful:
        inputs["laws"] = law_col
    platform = PlatformMotion(p[:9].reshape(3, 3), p[9:12], p[12:18])
    written = write_leg(group, q, v, V_base, platform, plan.scale, plan.leg_pivots[n])
    rotor = written.folding.array([np.array([options.rotor[c] for c in leg.tree_v]) for leg in group])
    out = leg_forces(
        written,
        (q, v, a, V_base, A_base),
        (platform, p[18:]),
        law,
        rotor,
        driven,
        options.velocity,
        plan.scale,
    )
    outputs = {name: pack(out[name]) for name, _ in SUMS} | {"guard": ca.SX(out["guard"])}
    if driven:
        outputs["motors"] = pack(out["motors"])
    inputs |= {"numbers": written.folding.symbol(), "platform": p_col}
    return cut("legs", [inputs], [outputs]), written.folding.table(len(group))


def _share(robot: HybridRobot, module: Module) -> Array:
    """Give each motor's share of the load, none where the robot does not say."""
    try:
        return load_share(robot, module, Sharing(None, "raise"))
    except ActuationError:
        return np.zeros(0)
