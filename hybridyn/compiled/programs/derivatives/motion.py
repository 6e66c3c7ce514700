"""Derivatives of modules' joint accelerations at given accelerations along their motions."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from ...equations.direct import write_motion
from ...equations.stages import Stage
from ...program import Call, Target
from ..direct import DirectCalls
from ..stage_calls import Stages
from ..writer import Writer
from .adjoints import Adjoints
from .columns import Coordinates, add_up, collect
from .dense import Block, new_block
from .nodes import Joiner, numbers_of


@dataclass(frozen=True)
class Motion:
    """Derivatives of the accelerations of connected modules, a = Psi u_dot + a_0.

    Attributes:
        Psi: Over u_dot.
        over_q, over_v: Over their positions (along their freedoms) and rates, at fixed u_dot.
    """

    Psi: Block
    over_q: Block
    over_v: Block


class Motions:
    """Add the derivatives of modules' motions to a program; equal modules share their code."""

    def __init__(self, writer: Writer) -> None:
        self._writer = writer
        self._code: dict[Any, list[Stage]] = {}
        self._joiner = Joiner(writer.kernels, writer.handed, limit=0.0)

    def of(self, modules: list[DirectCalls], at: Coordinates) -> Motion:
        """Add the calls of connected modules."""
        w, rows = self._writer, len(at.v)
        nodes = self._joiner.nodes([call for calls in modules for call in self._calls(calls)])
        adjoints = Adjoints(w, rows)
        adjoints.seed(w.result("a", at.v))
        motions = [calls.u_dot for calls in modules if calls.u_dot is not None]
        leaves = [w.from_given("q", at.q), w.from_given("v", at.v), *motions]
        adjoints.sweep(nodes, {x for leaf in leaves for x in numbers_of(leaf, 0)})
        blocks = [new_block(w, rows, size) for size in (sum(u.size for u in motions), rows, rows)]
        places: list[list[Target]] = [[block.rows, block.all] for block in blocks]
        patterns = (
            add_up(adjoints, [parts for u in motions for parts in adjoints.parts(u)], places[0]),
            collect(adjoints, "q", at.q, places[1], at),
            collect(adjoints, "v", at.v, places[2]),
        )
        pairs = zip(blocks, patterns, strict=True)
        return Motion(*(replace(block, pattern=pattern) for block, pattern in pairs))

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
