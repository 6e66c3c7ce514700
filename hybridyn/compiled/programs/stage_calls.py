"""Calls of the stages of a cut graph, and the places of the numbers that stages pass on."""

from __future__ import annotations

from typing import Any

from ..equations.stages import Stage
from ..program import Own, Shared, Source, Target
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

    def call(self, s: int, sources: dict[str, Source], targets: dict[str, Target]) -> None:
        """Add the call of a stage; a stage without outputs is skipped."""
        stage = self._stages[s]
        if not stage.outputs:
            return
        ins: list[Source] = [
            self._handed[name[1], s] if isinstance(name, tuple) else sources[name] for name in stage.inputs
        ]
        outs: list[Target] = []
        for i, name in enumerate(stage.outputs):
            if isinstance(name, tuple):
                place = self._writer.hand(self._copies, stage.function.numel_out(i))
                self._handed[s, name[1]] = place
                outs.append(place)
            else:
                outs.append(targets[name])
        self._writer.call(self._kernels[s], self._copies, ins, outs)
