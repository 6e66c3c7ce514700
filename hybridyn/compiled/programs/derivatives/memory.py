"""Reuse of memory: numbers that no later step reads make room for others, so that programs fit the caches."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from ...code.rules import check
from ...program import Add, Call, Each, Own, Program, Shared, Start, Turned


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
    shared, own = _regions(program, shared=True), _regions(program, shared=False)
    sizes = _allocate(shared), _allocate(own)
    moved_shared, moved_own = _moves(shared), _moves(own)

    def moved(end: Any) -> Any:
        """Return a source or target in its new place."""
        if isinstance(end, Own | Turned):
            return replace(end, start=moved_own.get(end.start, 0))
        return (
            replace(end, start=moved_shared.get(end.start, 0))
            if isinstance(end, Shared | Each | Add)
            else end
        )

    steps: list[Start | Call] = []
    for step in program.steps:
        if isinstance(step, Start):
            steps.append(replace(step, start=moved_shared.get(step.start, 0)))
            continue
        sources, targets = tuple(map(moved, step.sources)), tuple(map(moved, step.targets))
        steps.append(replace(step, sources=sources, targets=targets))
    return replace(program, steps=tuple(steps), shared=sizes[0], own=sizes[1])


def _spans(step: Start | Call, shared: bool) -> list[tuple[int, int]]:
    """Return start and end of the shared (or own) numbers that a step reads and writes."""
    if isinstance(step, Start):
        return [(step.start, step.start + len(step.values))] if shared and len(step.values) else []
    ends = (*step.sources, *step.targets)
    places = [end for end in ends if isinstance(end, Own | Turned | Shared | Each | Add)]
    copies = {Own: step.copies, Each: step.copies}
    return [
        (
            end.start,
            end.start + (end.rows if isinstance(end, Turned) else copies.get(type(end), 1)) * end.size,
        )
        for end in places
        if end.size and isinstance(end, Own | Turned) != shared
    ]


def _regions(program: Program, shared: bool) -> list[_Region]:
    """Return the regions of shared or own numbers, in the order of their places."""
    used = sorted((a, b, n) for n, step in enumerate(program.steps) for a, b in _spans(step, shared))
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
