"""Derivatives of modules' joint accelerations at given accelerations along their motions."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...equations.direct import write_motion
from ...equations.stages import Stage
from ...program import Call, Each, Own, Shared, Target
from ..direct import DirectCalls
from ..stage_calls import Stages
from ..writer import Writer
from .adjoints import Adjoints, Pattern
from .columns import Coordinates, add_up, collect
from .dense import Block, new_block
from .nodes import Joiner, Node, numbers_of


@dataclass(frozen=True)
class Motion:
    """Derivatives of the accelerations of connected modules, a = Psi u_dot + a_0.

    Attributes:
        nodes: Nodes that lead from u_dot to the accelerations.
        u_dot: Accelerations along the motions of each module.
        Psi: Derivatives over u_dot.
        over_q, over_v: Over their positions (along their freedoms) and rates, at fixed u_dot, and which
            accelerations they change.
    """

    nodes: list[Node]
    u_dot: list[Shared]
    Psi: Block
    over_q: tuple[Own, Pattern]
    over_v: tuple[Own, Pattern]


class Motions:
    """Add the derivatives of modules' motions to a program; equal modules share their code.

    Attributes:
        known: Places of local derivatives, for sweeps that go on through the motions.
    """

    def __init__(self, writer: Writer) -> None:
        self._writer = writer
        self._code: dict[Any, list[Stage]] = {}
        self._joiner = Joiner(writer.kernels, writer.handed, limit=0.0)
        self.known: dict[Any, tuple[Shared, Each]] = {}

    def of(self, modules: list[DirectCalls], at: Coordinates) -> Motion:
        """Add the calls of connected modules."""
        w, rows = self._writer, len(at.v)
        nodes = self._joiner.nodes([call for calls in modules for call in self._calls(calls)])
        adjoints = Adjoints(w, rows, self.known)
        adjoints.seed(w.result("a", at.v))
        motions = [calls.u_dot for calls in modules if calls.u_dot is not None]
        self.through(adjoints, nodes, motions, at)
        Psi = new_block(w, rows, sum(u.size for u in motions))
        read = [parts for u in motions for parts in adjoints.parts(u)]
        Psi = replace(Psi, pattern=add_up(adjoints, read, [Psi.all]))
        q, v = w.own(rows, rows), w.own(rows, rows)
        over_q = q, rows_of(collect(adjoints, "q", at.q, [q], at))
        over_v = v, rows_of(collect(adjoints, "v", at.v, [v]))
        return Motion(nodes, motions, Psi, over_q, over_v)

    def through(self, adjoints: Adjoints, nodes: list[Node], motions: list[Shared], at: Coordinates) -> None:
        """Sweep back from accelerations to positions, rates and u_dot."""
        w = self._writer
        leaves = [w.from_given("q", at.q), w.from_given("v", at.v), *motions]
        adjoints.sweep(nodes, {x for leaf in leaves for x in numbers_of(leaf, 0)})

    def _calls(self, calls: DirectCalls) -> list[Call]:
        """Return the calls that lead from u_dot to the accelerations; they are not made."""
        w, written, v_index = self._writer, calls.written, calls.module.v_index
        plan = calls.request.plans[calls.k]
        key = ("motion", id(plan), calls.options)
        if key not in self._code:
            self._code[key] = write_motion(f"motion_{len(self._code)}", plan, calls.options)
        stages = Stages(w, key, self._code[key], ["motion"] * 3)
        start = len(w.steps)
        assert calls.u_dot is not None
        sources = calls.sources() | {"u_dot": calls.u_dot, "a_legs": w.result("a", v_index[written.legs])}
        targets: dict[str, Target] = {f"platform {i}": place for i, place in calls.platforms.items()}
        targets |= {f"delta {i}": place for i, place in calls.deltas.items()}
        targets["a_core"] = w.result("a", v_index[written.joints])
        stages.call(0, sources, targets)
        stages.call(1, sources, targets)
        core = [step for step in w.steps[start:] if isinstance(step, Call)]
        middle = len(w.steps)
        stages.call(2, sources, {"a_wrists": w.result("a", v_index[written.wrists])})
        wrists = [step for step in w.steps[middle:] if isinstance(step, Call)]
        del w.steps[start:]
        return [*core, *calls.leg_calls, *wrists]


def rows_of(pattern: Pattern) -> Pattern:
    """Return which rows have an entry that is not always zero."""
    return np.array([row.any() for row in pattern], dtype=bool)
