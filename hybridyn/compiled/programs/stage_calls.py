"""Calls of the stages of a cut graph: which place holds what one stage hands to another."""

from __future__ import annotations

from typing import Any

from ..equations.stages import Stage
from ..program import Own, Shared, Source, Target
from .writer import Writer


class Stages:
    """The stages of one module (or one group of legs) in a program, called one after the other.

    What stages hand over goes to shared numbers for a single copy, to the copies' own for several.
    """

    def __init__(
        self, writer: Writer, key: Any, stages: list[Stage], parts: list[str], copies: int = 1
    ) -> None:
        self._writer, self._stages, self._copies = writer, stages, copies
        self._kernels = [
            writer.kernel((key, s), stage.function, part)
            for s, (stage, part) in enumerate(zip(stages, parts, strict=True))
        ]
        self._handed: dict[tuple[int, int], Shared | Own] = {}

    def call(self, s: int, sources: dict[str, Source], targets: dict[str, Target]) -> None:
        """Call a stage; stages that give nothing are left out.

        Args:
            s: The stage.
            sources: Where its named inputs come from.
            targets: Where its named outputs go.
        """
        stage = self._stages[s]
        if not stage.outputs:
            return
        ins: list[Source] = [
            self._handed[name[1], s] if isinstance(name, tuple) else sources[name] for name in stage.inputs
        ]
        outs: list[Target] = []
        for i, name in enumerate(stage.outputs):
            if isinstance(name, tuple):
                size = stage.function.numel_out(i)
                place = (
                    self._writer.shared(size) if self._copies == 1 else self._writer.own(self._copies, size)
                )
                self._handed[s, name[1]] = place
                outs.append(place)
            else:
                outs.append(targets[name])
        self._writer.call(self._kernels[s], self._copies, ins, outs)
