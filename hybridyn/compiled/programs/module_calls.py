"""Calls of one module in a program: stages and their ports, efforts on its joints; the base."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from ...spatial import Index, rotation_from_quaternion
from ...structure.module import Module
from ...symbols import dot
from ..equations.arguments import ChosenNumbers, decided_alike
from ..equations.expressions import pack, plain, symbols
from ..equations.leg_groups import Leg
from ..equations.request import Request
from ..equations.rigid import classical
from ..equations.stages import Stage, WrittenModule
from ..program import Add, Call, Each, Own, Shared, Source, Target, Worst
from .writer import Writer


class Stages:
    """The stages of one module (or one group of legs) in a program, called one after the other.

    Numbers that one stage passes to another are shared for a single copy, and the copies' own for several.
    """

    def __init__(
        self, writer: Writer, key: Any, stages: list[Stage], parts: list[str], copies: int = 1
    ) -> None:
        self._writer, self._stages, self._copies = writer, stages, copies
        self._kernels = [writer.kernel((key, s), stage.function, parts[s]) for s, stage in enumerate(stages)]
        self._handed: dict[tuple[int, int], Shared | Own] = {}

    def call(self, s: int, ports: Ports) -> None:
        """Add the call of a stage; a stage without outputs is skipped.

        Args:
            s: The number of the stage.
            ports: The places of its inputs and outputs. Shared numbers are allocated for other outputs, which
                are ports of later stages.
        """
        stage, w = self._stages[s], self._writer
        if not stage.outputs:
            return
        ins = [
            self._handed[name[1], s] if isinstance(name, tuple) else read(ports[name])
            for name in stage.inputs
        ]
        outs: list[Target] = []
        for i, name in enumerate(stage.outputs):
            size = stage.function.numel_out(i)
            if isinstance(name, tuple):
                place = self._handed[s, name[1]] = w.hand(self._copies, size)
                outs.append(place)
            elif name == "guard":
                outs.append(Worst())
            else:
                outs.append(ports[name] if name in ports else ports.setdefault(name, w.shared(size)))
        w.call(self._kernels[s], self._copies, ins, outs)


#: Places of inputs and outputs by their names in the stages. "platform 0" belongs to joint 0 of the tree, as
#: do sums over its legs; "V 0" to output 0.
Ports = dict[str, Any]

#: Ports of a module that are those of the output that carries it.
OF_BASE = {
    "V_base": "V", "A_base": "A", "I_base": "I", "b_base": "beta", "F_base": "F", "size_base": "size",
    "A0_base": "A0",
}  # fmt: skip


@dataclass
class ModuleCalls:
    """Calls of one module in a program.

    Attributes:
        request: The robot and its effects.
        writer: The program under construction.
        k: Index of the module.
        options: Options that its code depends on.
        written: Its code.
        stages: Its stages.
        below: The module that carries it, None for a module on the robot's base.
        ports: Places by name, first those of the robot's base if it moves.
        calls: Calls of the module in order, where they are asked for.
        legs: Groups of its legs, their stages and numbers, where they are called again.
    """

    request: Request
    writer: Writer
    k: int
    options: Any
    written: Any
    stages: Stages
    below: ModuleCalls | None
    ports: Ports
    calls: list[Call] = field(default_factory=list)
    legs: Sequence[tuple[tuple[Leg, ...], Stages, Source]] = ()

    def __post_init__(self) -> None:
        """Provide positions, rates and parameters."""
        self.ports |= self.coordinates([self.written])
        if self.request.plans[self.k].column is not None:
            index = self.request.parameter_index(self.k)
            self.ports["parameters"] = self.writer.from_given("parameters", index)

    @cached_property
    def module(self) -> Module:
        """The module."""
        return self.request.robot.modules[self.k]

    @property
    def groups(self) -> tuple[tuple[Leg, ...], ...]:
        """Its groups of equal legs."""
        return self.request.plans[self.k].parts.groups

    @property
    def idle(self) -> int:
        """Number of its idle motions, the first of its motions."""
        return len(self.request.plans[self.k].parts.all_idle)

    @property
    def joints(self) -> Index:
        """Indices of the freedoms of its core in the robot's v."""
        own = self.request.plans[self.k].parts.v
        return np.asarray(self.module.v_index[own[own >= 0]])

    def call(self, s: int) -> None:
        """Add the call of a stage."""
        if self.below is not None:
            output, known = self.module.parent_output, self.below.ports
            names = {name: f"{of} {output}" for name, of in OF_BASE.items()}
            self.ports |= {name: known[of] for name, of in names.items() if of in known}
        self.stages.call(s, self.ports)

    def allocate_motions(self) -> None:
        """Allocate "u_dot" and "Q" along all motions of the module, first of its legs, which idle."""
        w, m, plan = self.writer, self.module.mobility, self.request.plans[self.k]
        first = self.idle - plan.idle
        for name in ("u_dot", "Q"):
            whole = self.ports[name] = w.shared(m)
            self.ports[f"{name} of core"] = Shared(whole.start + first, m - first)

    def idle_ports(self, n: int) -> Ports:
        """Return the places of "u_dot" and "Q" along the idle motions of group n."""
        first = sum(len(group) for group in self.groups[:n] if group[0].idle)
        return {f"{name} of leg": Each(self.ports[name].start + first, 1) for name in ("u_dot", "Q")}

    def start_sums(self, sums: Sequence[tuple[str, int]]) -> None:
        """Start the sums over the legs of each platform, given by name and size, at zero."""
        for i in sorted({group[0].platform for group in self.groups}):
            for name, size in sums:
                self.ports[f"{name} {i}"] = self.writer.start(self.writer.shared(size), np.zeros(size))

    def call_legs(self, group: tuple[Leg, ...], legs: Stages, s: int, more: Ports) -> None:
        """Add the call of a stage of equal legs, whose ports are those of their platform, and `more`."""
        i = f" {group[0].platform}"
        own = {name.removesuffix(i): x for name, x in self.ports.items() if name.endswith(i)}
        legs.call(s, self.ports | self.coordinates(group) | own | more)

    def of_each_leg(self, n: int, name: str, stage: Stage) -> Each:
        """Allocate an output of each leg of group n, all of which are the port "NAME n" of the module."""
        size, legs = stage.function.numel_out(stage.outputs.index(name)), len(self.groups[n])
        each = self.writer.each(legs, size)
        self.ports[f"{name} {n}"] = Shared(each.start, size * legs)
        return each

    def coordinates(self, readers: Sequence[WrittenModule | Leg]) -> Ports:
        """Return places of positions, rates and, if they are inputs, accelerations for equal readers."""
        w = self.writer
        q = self.module.q_index[np.array([reader.q for reader in readers])]
        v = self.module.v_index[np.array([reader.v for reader in readers])]
        out = {"q": w.from_given("q", q), "v": w.from_given("v", v)}
        return out | ({"a": w.from_given("a", v)} if "a" in w.given or "a" in w.computed else {})


def read(place: Any) -> Any:
    """Return the source that reads a place; that of a sum reads its numbers."""
    return Shared(place.start, place.size) if isinstance(place, Add) else place


def same_structure(request: Request, w: Writer) -> None:
    """Add a guard that rejects arguments with which the robot has another structure."""
    chosen = request.arguments
    if not isinstance(chosen, ChosenNumbers) or not chosen.traced.decisions:
        return
    column, guard = chosen.column, decided_alike(chosen.traced.decisions)
    kernel = w.kernel("structure", ca.Function("structure", [column], [guard]), "parameters")
    w.call(kernel, 1, [w.from_given("parameters", np.arange(chosen.size))], [Worst()])


def moving_base(request: Request, w: Writer, acceleration: str) -> Ports:
    """Return the ports of a moving base's twist and acceleration (`GivenColumns.base_twist`), or nothing.

    Args:
        request: The robot and its effects.
        w: The program under construction.
        acceleration: Input that begins with the base's acceleration; if it is not "a", results begin with it.
    """
    if request.robot.base != "moving":
        return {}
    (q_col, q), (v_col, v), (a_col, a) = symbols("q", 4), symbols("v", 6), symbols("a", 6)
    velocity, report = request.on.velocity is not None, acceleration != "a"
    A = classical(v, a) if velocity else a.copy()
    A[:3] = A[:3] - dot(rotation_from_quaternion(q).T, plain(request.gravity))
    V = pack(v[3:]) if velocity else v_col
    outputs = [V, pack(A), pack(a)] if report else [V, pack(A)]
    kernel = w.kernel(("root", report), ca.Function("root", [q_col, v_col, a_col], outputs), "kinematics")
    ports = {"V_base": w.shared(V.numel()), "A_base": w.shared(6)}
    alone = {"A0_base": ports["A_base"]}
    given = (("q", np.arange(3, 7)), ("v", np.arange(6)), (acceleration, np.arange(6)))
    more = [w.result("a", np.arange(6))] if report else []
    w.call(kernel, 1, [w.from_given(name, index) for name, index in given], [*ports.values(), *more])
    return ports | alone
