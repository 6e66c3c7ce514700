"""Rules of programs: both drivers agree, unused calls are left out, and memory is used again."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ..program import Call, Own, Program, Shared, Start

Span = tuple[str, int, int]


def overlap(a: Span, b: Span) -> bool:
    """Return whether two spans share memory."""
    return bool(a[0]) and a[0] == b[0] and max(a[1], b[1]) < min(a[2], b[2])


def trimmed(program: Program) -> Program:
    """Return a program without calls whose outputs are all empty and without uncalled kernels."""
    steps = [
        step
        for step in program.steps
        if isinstance(step, Start) or any(end.at(step.copies).size for end in step.targets)
    ]
    used = sorted({step.kernel for step in steps if isinstance(step, Call)})
    renamed = {old: new for new, old in enumerate(used)}
    return replace(
        program,
        steps=tuple(
            replace(step, kernel=renamed[step.kernel]) if isinstance(step, Call) else step for step in steps
        ),
        kernels=tuple(program.kernels[old] for old in used),
    )


def check(program: Program) -> None:
    """Check that a program computes the same with samples in the lanes and with copies in the lanes.

    Raises:
        ValueError: A size or a place does not fit; a number is read before it is written; own numbers are
            read with other sizes than they were written with; a call of several copies reads what it sums,
            or writes shared numbers; or a result is never written.
    """
    own: dict[int, tuple[int, int]] = {}
    room = dict(zip(("given", "result", "shared", "own"), program.sizes, strict=True))
    known = {memory: np.zeros(room[memory], dtype=bool) for memory in ("shared", "result")}
    for step in program.steps:
        if isinstance(step, Start):
            if step.start + len(step.values) > program.shared:
                raise ValueError(f"program '{program.name}' starts shared numbers that are not there")
            known["shared"][step.start : step.start + len(step.values)] = True
            continue
        where = f"program '{program.name}', kernel '{program.kernels[step.kernel].name}'"
        _check_sizes(program, step, where)
        reads, writes = ([x.span(step.copies) for x in ends] for ends in (step.sources, step.targets))
        for memory, a, b in [*reads, *writes]:
            if memory and not 0 <= a <= b <= room[memory]:
                raise ValueError(f"{where}: {memory} has no numbers {a}..{b}")
        for source, (memory, a, b) in zip(step.sources, reads, strict=True):
            if memory in known and not known[memory][source.at(step.copies)].all():
                what = "a result that was" if memory == "result" else f"shared numbers {a}..{b} that were"
                raise ValueError(f"{where} reads {what} not written")
            if isinstance(source, Own) and source.size:  # an empty block takes no room
                written = own.get(source.start)
                if written != (source.size, step.copies):
                    raise ValueError(f"{where} reads own numbers otherwise than they were written")
        _check_copies(step, reads, writes, where)
        for target, span in zip(step.targets, writes, strict=True):
            if isinstance(target, Own) and target.size:
                own[target.start] = (target.size, step.copies)
            if span[0] in known:
                known[span[0]][target.at(step.copies)] = True
    if not known["result"].all():
        raise ValueError(f"program '{program.name}': result {np.argmin(known['result'])} is never written")


def _check_copies(step: Call, reads: list[Span], writes: list[Span], where: str) -> None:
    """Raise if a call of several copies writes shared numbers, or reads what it sums."""
    for target, span in zip(step.targets, writes, strict=True):
        if step.copies > 1 and isinstance(target, Shared):
            raise ValueError(f"{where} writes shared numbers from {step.copies} copies")
        if step.copies > 1 and target.adds and any(overlap(span, read) for read in reads):
            raise ValueError(f"{where} reads what its copies add up")


def _check_sizes(program: Program, call: Call, where: str) -> None:
    """Check that sources and targets have the sizes of the kernel."""
    f = program.kernels[call.kernel].function
    pairs = [(f.nnz_in(i), x) for i, x in enumerate(call.sources)] if f.n_in() == len(call.sources) else None
    if pairs is None or f.n_out() != len(call.targets):
        raise ValueError(f"{where} takes {f.n_in()} inputs and gives {f.n_out()} outputs")
    for size, end in [*pairs, *((f.nnz_out(i), x) for i, x in enumerate(call.targets))]:
        if end.at(call.copies).shape != (call.copies, size):
            raise ValueError(f"{where}: {end} is not of shape {(call.copies, size)}")


def _leading(program: Program) -> Program:
    """Return a program without the steps that lead to no result and no guard."""
    read = {"shared": np.zeros(program.shared, dtype=bool), "own": np.zeros(program.own, dtype=bool)}
    kept: list[Start | Call] = []
    for step in reversed(program.steps):
        if isinstance(step, Start):
            if read["shared"][step.start : step.start + len(step.values)].any():
                kept.append(step)
            continue
        written = [(end, end.at(step.copies)) for end in step.targets]
        if not any(end.memory not in read or read[end.memory][at].any() for end, at in written if at.size):
            continue
        kept.append(step)
        for end, at in written:
            if end.memory in read:
                read[end.memory][at] = end.adds
        for source in step.sources:
            if source.memory in read:
                read[source.memory][source.at(step.copies)] = True
    return replace(program, steps=tuple(reversed(kept)))


def compacted(program: Program) -> Program:
    """Return a program that computes the same results in less memory, without what leads to none of them.

    Raises:
        ValueError: As `check`; what is read before it is written would be hidden afterwards.
    """
    check(program)
    program = _leading(program)
    (shared, of_shared), (own, of_own) = (_moves(program, memory) for memory in ("shared", "own"))
    places = {"shared": of_shared, "own": of_own}

    def moved(end: Any) -> Any:
        """Return a source, target or start in its new place."""
        memory = "shared" if isinstance(end, Start) else end.memory
        return replace(end, start=places[memory].get(end.start, 0)) if memory in places else end

    steps = tuple(
        moved(step)
        if isinstance(step, Start)
        else replace(step, sources=tuple(map(moved, step.sources)), targets=tuple(map(moved, step.targets)))
        for step in program.steps
    )
    return replace(program, steps=steps, shared=shared, own=own)


def _spans(step: Start | Call, memory: str) -> list[tuple[int, int]]:
    """Return start and end of the numbers of a memory that a step reads and writes."""
    if isinstance(step, Start):
        size = len(step.values) * (memory == "shared")
        return [(step.start, step.start + size)] if size else []
    spans = [end.span(step.copies) for end in (*step.sources, *step.targets)]
    return [(a, b) for of, a, b in spans if of == memory]


def _moves(program: Program, memory: str) -> tuple[int, dict[int, int]]:
    """Return the size that a memory needs, and the new place of each of its numbers.

    Numbers that steps read and write together stay together: a region, from the first step to the last one
    that reads or writes it. Each goes into the first gap that is wide enough.
    """
    used = sorted((a, b, n) for n, step in enumerate(program.steps) for a, b in _spans(step, memory))
    regions: list[list[int]] = []  # start, end, first and last step
    for a, b, n in used:
        if regions and a < regions[-1][1]:
            _, end, first, last = regions[-1]
            regions[-1][1:] = max(end, b), min(first, n), max(last, n)
        else:
            regions.append([a, b, n, n])
    live: list[tuple[int, int, int]] = []  # place, end and last step
    moves: dict[int, int] = {}
    for start, stop, first, last in sorted(regions, key=lambda region: region[2]):
        live = sorted(region for region in live if region[2] >= first)
        at = 0
        for place, end, _ in live:
            if place - at >= stop - start:
                break
            at = max(at, end)
        live.append((at, at + stop - start, last))
        moves |= zip(range(start, stop), range(at, at + stop - start), strict=True)
    return max(moves.values(), default=-1) + 1, moves
