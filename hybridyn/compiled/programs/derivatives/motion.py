"""Derivatives of each module's joint accelerations at given accelerations along its motions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ...equations.direct import write_motion
from ...equations.stages import Stage
from ...program import Call, Each, Own, Target
from ..direct import DirectCalls
from ..stage_calls import Stages
from ..writer import Writer
from .adjoints import Adjoints
from .columns import Coordinates, add_up, collect
from .nodes import Joiner, numbers_of


@dataclass(frozen=True)
class Motion:
    """Derivatives of a module's accelerations, a = Psi u_dot + a_0, each as rows in lanes and for all lanes.

    Attributes:
        Psi: Over u_dot.
        over_q, over_v: Over its positions (along its freedoms) and rates, at fixed u_dot.
        Psi_all, over_q_all, over_v_all: The same.
    """

    Psi: Own
    over_q: Own
    over_v: Own
    Psi_all: Each
    over_q_all: Each
    over_v_all: Each


class Motions:
    """Add the derivatives of modules' motions to a program; equal modules share their code."""

    def __init__(self, writer: Writer) -> None:
        self._writer = writer
        self._code: dict[Any, list[Stage]] = {}

    def of(self, calls: DirectCalls, at: Coordinates) -> Motion:
        """Add the calls of one module.

        Args:
            calls: Its calls in the direct model, which has run.
            at: Its coordinates.
        """
        w, rows = self._writer, len(at.v)
        assert calls.u_dot is not None
        nodes = Joiner(w.kernels, w.handed).nodes(self._calls(calls))
        adjoints = Adjoints(w, rows)
        adjoints.seed(w.result("a", at.v))
        leaves = (w.from_given("q", at.q), w.from_given("v", at.v), calls.u_dot)
        adjoints.sweep(nodes, {x for leaf in leaves for x in numbers_of(leaf, 0)})
        both = []
        for size in (calls.u_dot.size, rows, rows):
            both.append((w.own(rows, size), w.each(rows, size)))
        (Psi, Psi_all), (over_q, over_q_all), (over_v, over_v_all) = both
        add_up(adjoints, adjoints.parts(calls.u_dot), [Psi, Psi_all])
        collect(adjoints, "q", at.q, [over_q, over_q_all], at)
        collect(adjoints, "v", at.v, [over_v, over_v_all])
        return Motion(Psi, over_q, over_v, Psi_all, over_q_all, over_v_all)

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
