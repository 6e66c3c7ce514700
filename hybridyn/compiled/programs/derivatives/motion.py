"""Joint accelerations of connected modules from those along their motions, as nodes to be differentiated."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from ....spatial import Index
from ...equations.direct import write_motion
from ...equations.stages import Stage
from ...program import Call, Given, Result, Shared, Source, Target
from ..direct import DirectCalls
from ..stage_calls import Stages
from ..writer import Writer
from .nodes import Joiner, Node


class Motions:
    """Provide the nodes of modules' motions, a = Psi u_dot + a_0; equal modules share their code."""

    def __init__(self, writer: Writer, instead: dict[Shared, Shared] | None = None) -> None:
        """Prepare the motions.

        Args:
            writer: The program under construction.
            instead: Places that are read instead of places of the direct model. Accelerations are then user
                inputs, and the direct model is not evaluated; None where it is.
        """
        self._writer, self._instead = writer, instead
        self._code: dict[Any, list[Stage]] = {}
        self._joiner = Joiner(writer.kernels, writer.handed, limit=0.0)

    def nodes(self, modules: list[DirectCalls]) -> list[Node]:
        """Return the nodes that lead from u_dot of connected modules to the accelerations."""
        calls = [call for x in modules for call in self._calls(x)]
        return self._joiner.nodes([self._moved(call) for call in calls])

    def accelerations(self, index: Index) -> Source:
        """Return the accelerations of some freedoms."""
        return (
            self._writer.result("a", index) if self._instead is None else self._writer.from_given("a", index)
        )

    def evaluate(self, calls: DirectCalls) -> None:
        """Add the calls that compute the motion of a module's platforms, which its legs read."""
        w = self._writer
        core = [self._moved(call) for call in self._calls(calls, core=True)]
        for call in core:
            scratch = [w.shared(x.index.size) if isinstance(x, Given) else x for x in call.targets]
            w.steps.append(replace(call, targets=tuple(scratch)))

    def _moved(self, call: Call) -> Call:
        """Return a call that reads and writes other places instead of those of the direct model."""
        if self._instead is None:
            return call
        w, instead = self._writer, self._instead

        def moved(end: Any) -> Any:
            """Return the place instead of a source or target."""
            if isinstance(end, Result) and (end.index >= w.results["a"]).all():
                return w.from_given("a", end.index - w.results["a"])
            return instead.get(end, end) if isinstance(end, Shared) else end

        return replace(call, sources=tuple(map(moved, call.sources)), targets=tuple(map(moved, call.targets)))

    def _calls(self, calls: DirectCalls, *, core: bool = False) -> list[Call]:
        """Return the calls from u_dot to the accelerations, or those of the core; they are not made."""
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
        own = w.calls_from(start)
        middle = len(w.steps)
        stages.call(2, sources, {"a_wrists": w.result("a", v_index[written.wrists])})
        wrists = w.calls_from(middle)
        del w.steps[start:]
        return own if core else [*own, *calls.leg_calls, *wrists]
