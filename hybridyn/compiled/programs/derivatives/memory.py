"""Reuse of memory: numbers that no later step reads make room for others, so that programs fit the caches."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from ...code.rules import check
from ...program import Call, Program, Start


@dataclass
class _Region:
    """Numbers that steps read and write together.

    Attributes:
        start, stop: Where they are.
        first, last: First and last step that reads or writes one of them.
        place: Where they go.
    """

    start: int
    stop: int
    first: int
    last: int
    place: int = 0


def compacted(program: Program) -> Program:
    """Return a program that computes the same in less memory.

    Raises:
        ValueError: As `check`; what is read before it is written would be hidden afterwards.
    """
    check(program)
    regions = {memory: _regions(program, memory) for memory in ("shared", "own")}
    sizes = {memory: _allocate(of) for memory, of in regions.items()}
    places = {memory: _moves(of) for memory, of in regions.items()}

    def moved(end: Any) -> Any:
        """Return a source, target or start in its new place."""
        memory = "shared" if isinstance(end, Start) else end.memory
        return replace(end, start=places[memory].get(end.start, 0)) if memory in places else end

    steps: list[Start | Call] = []
    for step in program.steps:
        if isinstance(step, Start):
            steps.append(moved(step))
            continue
        sources, targets = tuple(map(moved, step.sources)), tuple(map(moved, step.targets))
        steps.append(replace(step, sources=sources, targets=targets))
    return replace(program, steps=tuple(steps), shared=sizes["shared"], own=sizes["own"])


def _spans(step: Start | Call, memory: str) -> list[tuple[int, int]]:
    """Return start and end of the numbers of a memory that a step reads and writes."""
    if isinstance(step, Start):
        return (
            [(step.start, step.start + len(step.values))] if memory == "shared" and len(step.values) else []
        )
    spans = [end.span(step.copies) for end in (*step.sources, *step.targets)]
    return [(a, b) for of, a, b in spans if of == memory]


def _regions(program: Program, memory: str) -> list[_Region]:
    """Return the regions of a memory, in the order of their places."""
    used = sorted((a, b, n) for n, step in enumerate(program.steps) for a, b in _spans(step, memory))
    out: list[_Region] = []
    for a, b, n in used:
        if out and a < out[-1].stop:
            region = out[-1]
            region.stop = max(region.stop, b)
            region.first, region.last = min(region.first, n), max(region.last, n)
        else:
            out.append(_Region(a, b, n, n))
    return out


def _allocate(regions: list[_Region]) -> int:
    """Place regions, each in the first gap that is wide enough; return the total size."""
    live: list[_Region] = []
    total = 0
    for region in sorted(regions, key=lambda region: region.first):
        live = [other for other in live if other.last >= region.first]
        at, size = 0, region.stop - region.start
        for other in sorted(live, key=lambda other: other.place):
            if other.place - at >= size:
                break
            at = max(at, other.place + other.stop - other.start)
        region.place = at
        live.append(region)
        total = max(total, at + size)
    return total


def _moves(regions: list[_Region]) -> dict[int, int]:
    """Return the new place of each number."""
    return {
        k: region.place + k - region.start for region in regions for k in range(region.start, region.stop)
    }
