"""Rules of programs: both drivers agree, unused calls are left out, and memory is used again."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..program import Call, Own, Program, Shared, Start

Span = tuple[str, int, int]


def overlap(a: Span, b: Span) -> bool:
    """Return whether two spans share memory."""
    return bool(a[0]) and a[0] == b[0] and max(a[1], b[1]) < min(a[2], b[2])


def trimmed(program: Program) -> Program:
    """Return a program without calls whose outputs are all empty and without uncalled kernels."""
    steps: list[Start | Call] = []
    number: dict[int, int] = {}
    for step in program.steps:
        if isinstance(step, Start):
            steps.append(step)
            continue
        function = program.kernels[step.kernel].function
        if any(function.nnz_out(i) for i in range(function.n_out())):
            steps.append(replace(step, kernel=number.setdefault(step.kernel, len(number))))
    return replace(program, steps=tuple(steps), kernels=tuple(program.kernels[old] for old in number))


def check(program: Program) -> None:
    """Check that a program computes the same with samples in the lanes and with copies in the lanes.

    Raises:
        ValueError: A size or a place does not fit; a number is read before it is written; own numbers are
            read with other sizes than they were written with; a call of several copies reads what it sums,
            or writes shared numbers; or a result is never written.
    """
    own: dict[int, tuple[int, int]] = {}
    shared = np.zeros(program.shared, dtype=bool)
    result = np.zeros(sum(size for _, size in program.outputs), dtype=bool)
    room = {"given": sum(size for _, size in program.inputs), "result": len(result)}
    room |= {"shared": program.shared, "own": program.own}
    for step in program.steps:
        if isinstance(step, Start):
            if step.start + len(step.values) > program.shared:
                raise ValueError(f"program '{program.name}' starts shared numbers that are not there")
            shared[step.start : step.start + len(step.values)] = True
            continue
        where = f"program '{program.name}', kernel '{program.kernels[step.kernel].name}'"
        _check_sizes(program, step, where)
        reads, writes = ([x.span(step.copies) for x in ends] for ends in (step.sources, step.targets))
        known = {"shared": shared, "result": result}
        for memory, a, b in [*reads, *writes]:
            if memory and not 0 <= a <= b <= room[memory]:
                raise ValueError(f"{where}: {memory} has no numbers {a}..{b}")
        for source, (memory, a, b) in zip(step.sources, reads, strict=True):
            if memory in known and not known[memory][source.at(step.copies)].all():
                what = "a result that was" if memory == "result" else f"shared numbers {a}..{b} that were"
                raise ValueError(f"{where} reads {what} not written")
            if isinstance(source, Own) and own.get(source.start) != (source.size, step.copies):
                raise ValueError(f"{where} reads own numbers otherwise than they were written")
        for target, span in zip(step.targets, writes, strict=True):
            if step.copies > 1 and isinstance(target, Shared):
                raise ValueError(f"{where} writes shared numbers from {step.copies} copies")
            if step.copies > 1 and target.adds and any(overlap(span, read) for read in reads):
                raise ValueError(f"{where} reads what its copies add up")
            if isinstance(target, Own):
                own[target.start] = (target.size, step.copies)
            if span[0] in known:
                known[span[0]][target.at(step.copies)] = True
    if not result.all():
        raise ValueError(f"program '{program.name}': result {int(np.argmin(result))} is never written")


def _check_sizes(program: Program, call: Call, where: str) -> None:
    """Check that sources and targets have the sizes of the kernel."""
    f = program.kernels[call.kernel].function
    pairs = [(f.nnz_in(i), x) for i, x in enumerate(call.sources)] if f.n_in() == len(call.sources) else None
    if pairs is None or f.n_out() != len(call.targets):
        raise ValueError(f"{where} takes {f.n_in()} inputs and gives {f.n_out()} outputs")
    for size, end in [*pairs, *((f.nnz_out(i), x) for i, x in enumerate(call.targets))]:
        if end.at(call.copies).shape != (call.copies, size):
            raise ValueError(f"{where}: {end} is not of shape {(call.copies, size)}")


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
