"""The direct model of a whole robot as a program: three sweeps over its modules."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin

from ..module import Module
from ..spatial import Array
from .choices import Request
from .core import Plan
from .direct import DirectModule, DirectOptions, base_twist, write_direct
from .efforts import Efforts
from .expressions import pack, plain, symbols, upper, zeros
from .legs import PlatformMotion, leg_accelerations, leg_sums, write_leg
from .parts import Leg
from .program import Add, Constants, Program, Shared, Source, Target, Worst
from .rigid import inertia_matrix
from .roots import moving_base
from .slots import Writer
from .stages import Stages
from .staging import Stage, cut

PARTS = ["kinematics", "inertia", "accelerations", "wrists"]
SUMS = (("S1", 10), ("B", 36), ("L", 21), ("b_base", 6), ("b_delta", 6))


@dataclass
class _ModuleCalls:
    """One module in the program."""

    plan: Plan
    written: DirectModule
    stages: Stages
    legs: list[tuple[tuple[Leg, ...], Stages, Constants]]
    V: dict[int, Shared]
    A: dict[int, Shared]
    articulated: dict[int, tuple[Add, Add]]
    sums: dict[tuple[int, str], Add] = field(default_factory=dict)
    platforms: dict[int, Shared] = field(default_factory=dict)


def direct_program(request: Request) -> Program:
    """Write the direct model of a robot."""
    robot = request.robot
    inputs = [("q", robot.nq), ("v", robot.nv), ("tau", len(robot.motors))]
    if robot.base == "moving":
        inputs.append(("base_acceleration", 6))
    if request.parameters:
        inputs.append(("parameters", 10 * len(robot.bodies.bodies)))
    w = Writer("ddm", inputs, [("a", robot.nv)])
    builder = _Builder(request, w)
    given = w.from_given("base_acceleration", np.arange(6)) if robot.base == "moving" else None
    root = moving_base(request, w, given, report=True) if given else None
    modules: list[_ModuleCalls] = []
    for k in range(len(robot.modules)):
        modules.append(builder.outwards(k, modules, root))
    for k in reversed(range(len(modules))):
        builder.inwards(k, modules)
    for k in range(len(modules)):
        builder.accelerate(k, modules, root)
    return w.program()


class _Builder:
    """Writes the calls of one module after the other."""

    def __init__(self, request: Request, writer: Writer) -> None:
        self.request, self.w = request, writer
        self.efforts = Efforts(request, writer)
        self._written: dict[Any, DirectModule] = {}
        self._legs: dict[Any, tuple[list[Stage], Any]] = {}

    def outwards(
        self, k: int, modules: list[_ModuleCalls], root: tuple[Source, Source] | None
    ) -> _ModuleCalls:
        """Write motion outwards: platforms, twists, and what the legs bring."""
        request, w = self.request, self.w
        module, plan = request.robot.modules[k], request.plans[k]
        options = self._options(k)
        key = (id(plan), options)
        if key not in self._written:
            self._written[key] = write_direct(f"module_{len(self._written)}", plan, options)
        written = self._written[key]
        calls = _ModuleCalls(plan, written, Stages(w, key, written.stages, PARTS), [], {}, {}, {})
        sources = self._positions(k, calls)
        if module.parent >= 0:
            sources["V_base"] = modules[module.parent].V[module.parent_output]
        elif root is not None:
            sources["V_base"] = root[0]
        calls.platforms = {i: w.shared(18) for i in written.platforms}
        targets: dict[str, Target] = {f"platform {i}": place for i, place in calls.platforms.items()}
        for o, carried in enumerate(options.carries):
            if carried:
                own = upper(inertia_matrix(plain(options.inertias[o]))).astype(float)
                if request.parameters:
                    own = np.zeros(21)
                calls.V[o] = w.shared(3 if options.velocity else 6)
                places = w.shared(21), w.shared(6)
                calls.articulated[o] = (w.start(places[0], own), w.start(places[1], np.zeros(6)))
                targets |= {f"V {o}": calls.V[o], f"bias {o}": calls.articulated[o][1]}
                targets[f"own {o}"] = calls.articulated[o][0]
        calls.stages.call(0, sources, targets)
        self._legs_outwards(k, calls, options, sources)
        return calls

    def _options(self, k: int) -> DirectOptions:
        """Give the options of a module's code."""
        request, module = self.request, self.request.robot.modules[k]
        outputs = range(len(module.mechanism.spec.outputs))
        return DirectOptions(
            base=request.root(module),
            carries=tuple(bool(request.children(k, o)) for o in outputs),
            inertias=request.output_inertias(k),
            velocity=request.on.velocity is not None,
            rotor=request.rotor(module),
            motors=tuple(i for i, mark in enumerate(request.marks(module)) if mark),
            usual=self._usual(k),
        )

    def _usual(self, k: int) -> tuple[float, ...]:
        """Give what each freedom of a module without loops that carries others moves, its joints locked."""
        module = self.request.robot.modules[k]
        m = module.mechanism
        outputs = range(len(m.spec.outputs))
        if (
            len(m.closures.row_slices)
            or m.spec.wrists
            or not any(self.request.children(k, o) for o in outputs)
        ):
            return ()
        return tuple(self._locked[module.v_index].tolist())

    @cached_property
    def _locked(self) -> Array:
        """What each freedom moves at most, all other joints locked, at some postures, shape (nv,)."""
        robot, data = self.request.robot, self.request.robot.model.createData()
        rng = np.random.default_rng(0)
        postures = [robot.home] + [
            pin.integrate(robot.model, robot.home, rng.normal(size=robot.nv)) for _ in range(7)
        ]
        out: Array = np.max([np.diag(pin.crba(robot.model, data, q)) for q in postures], axis=0)
        return out

    def _legs_outwards(
        self,
        k: int,
        calls: _ModuleCalls,
        options: DirectOptions,
        sources: dict[str, Source],
    ) -> None:
        """Write what each group of legs brings, summed by platform."""
        w, module = self.w, self.request.robot.modules[k]
        sums = {
            (i, name): w.start(w.shared(size), np.zeros(size))
            for i in sorted({group[0].platform for group in calls.plan.parts.groups})
            for name, size in SUMS
        }
        calls.sums = sums
        for n, group in enumerate(calls.plan.parts.groups):
            rotor = np.array([[options.rotor[c] for c in leg.tree_v] for leg in group])
            forced = [j for j, c in enumerate(group[0].tree_v) if c in options.motors]
            key = (id(calls.plan), n, options.base is None, options.velocity, options.rotor)
            if key not in self._legs:
                self._legs[key] = _write_group(calls.plan, n, options, rotor, forced)
            stages, table = self._legs[key]
            legs = Stages(w, ("legs", key), stages, ["legs", "legs' accelerations"], len(group))
            numbers = Constants(table)
            given: dict[str, Source] = {
                "numbers": numbers,
                "q": w.from_given("q", module.q_index[np.array([leg.q for leg in group])]),
                "v": w.from_given("v", module.v_index[np.array([leg.v for leg in group])]),
                "platform": calls.platforms[group[0].platform],
            }
            if forced:
                given["tau"] = self.efforts.of(k, np.array([leg.tree_v[forced] for leg in group]))
            if options.base is None:
                given["V_base"] = sources["V_base"]
            out: dict[str, Target] = {name: sums[group[0].platform, name] for name, _ in SUMS}
            legs.call(0, given, out | {"guard": Worst()})
            calls.legs.append((group, legs, numbers))

    def inwards(self, k: int, modules: list[_ModuleCalls]) -> None:
        """Write articulated inertias inwards."""
        module, calls = self.request.robot.modules[k], modules[k]
        sources: dict[str, Source] = {
            f"{name} {i}": Shared(place.start, place.size) for (i, name), place in calls.sums.items()
        }
        for o, (inertia, bias) in calls.articulated.items():
            sources[f"I {o}"] = Shared(inertia.start, inertia.size)
            sources[f"beta {o}"] = Shared(bias.start, bias.size)
        if len(calls.written.tau):
            sources["tau"] = self.efforts.of(k, calls.written.tau[None])
        sources |= self._positions(k, calls)
        targets: dict[str, Target] = {"guard": Worst()}
        if module.parent >= 0:
            below = modules[module.parent].articulated[module.parent_output]
            targets |= {"I_base": below[0], "b_base": below[1]}
        elif self.request.robot.base == "moving":
            targets |= {"I_base": self.w.shared(21), "b_base": self.w.shared(6)}
        calls.stages.call(1, sources, targets)

    def _parameters(self, module: Module) -> dict[str, Source]:
        """Give the source of a module's inertial parameters, where they are inputs."""
        if not self.request.parameters:
            return {}
        return {"parameters": self.w.from_given("parameters", self.request.parameter_index(module))}

    def _positions(self, k: int, calls: _ModuleCalls) -> dict[str, Source]:
        """Give the sources of positions and rates."""
        module = self.request.robot.modules[k]
        return {
            "q": self.w.from_given("q", module.q_index[calls.written.q]),
            "v": self.w.from_given("v", module.v_index[calls.written.v]),
        } | self._parameters(module)

    def accelerate(self, k: int, modules: list[_ModuleCalls], root: tuple[Source, Source] | None) -> None:
        """Write accelerations outwards: the core, the legs, the wrists."""
        w, module, calls = self.w, self.request.robot.modules[k], modules[k]
        sources = self._positions(k, calls)
        if module.parent >= 0:
            below = modules[module.parent]
            sources |= {"A_base": below.A[module.parent_output], "V_base": below.V[module.parent_output]}
        elif root is not None:
            sources |= {"V_base": root[0], "A_base": root[1]}
        deltas = {i: w.shared(6) for i in calls.written.platforms}
        calls.A = {o: w.shared(6) for o in calls.V}
        targets: dict[str, Target] = {f"delta {i}": place for i, place in deltas.items()}
        targets |= {f"A {o}": place for o, place in calls.A.items()}
        targets["a_core"] = w.result("a", module.v_index[calls.written.joints])
        calls.stages.call(2, sources, targets)
        for group, legs, numbers in calls.legs:
            at = module.v_index[np.array([leg.v for leg in group])]
            legs.call(1, {"numbers": numbers, "delta": deltas[group[0].platform]}, {"a": w.result("a", at)})
        sources["a_legs"] = w.result("a", module.v_index[calls.written.legs])
        calls.stages.call(
            3, sources, {"a_wrists": w.result("a", module.v_index[calls.written.wrists]), "guard": Worst()}
        )


def _write_group(
    plan: Plan, n: int, options: DirectOptions, rotor: np.ndarray[Any, Any], forced: list[int]
) -> tuple[list[Stage], Any]:
    """Write the stages of a group of legs: what they bring, and their accelerations."""
    group = plan.parts.groups[n]
    leg = group[0]
    (q_col, q), (v_col, v) = symbols("q", len(leg.q)), symbols("v", len(leg.v))
    V_col, V_base = base_twist(options.velocity)
    if options.base is not None:
        V_base = zeros(6)
    p_col, p = symbols("platform", 18)
    tau_col, given = symbols("tau", len(forced))
    d_col, delta = symbols("delta", 6)
    tau = zeros(len(leg.v))
    tau[forced] = given
    platform = PlatformMotion(p[:9].reshape(3, 3), p[9:12], p[12:])
    written = write_leg(group, q, v, V_base, platform, plan.scale, plan.leg_pivots[n])
    sums = leg_sums(written, tau, options.velocity, written.folding.array(list(rotor)))
    inputs = {"numbers": written.folding.symbol(), "q": q_col, "v": v_col, "platform": p_col}
    if options.base is None:
        inputs["V_base"] = V_col
    if forced:
        inputs["tau"] = tau_col
    outputs = {name: pack(sums[name]) for name, _ in SUMS} | {"guard": ca.SX(written.guard)}
    stages = cut(
        "legs", [inputs, {"delta": d_col}], [outputs, {"a": pack(leg_accelerations(written, delta))}]
    )
    return stages, written.folding.table(len(group))
