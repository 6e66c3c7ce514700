"""Check that both drivers of a program agree, and remove unused calls and kernels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..program import Add, Call, Constants, Each, Given, Own, Program, Result, Shared, Start, Turned, Worst

Span = tuple[str, int, int]


def spans(call: Call, given: int) -> list[Span]:
    """Return the memory spans (place, start, end) of a call's sources, or of its targets for given = 1."""
    out: list[Span] = []
    for end in call.targets if given else call.sources:
        match end:
            case Given(index):
                out.append(("given", *_range(index)))
            case Result(index):
                out.append(("result", *_range(index)))
            case Shared(start, size) | Add(start, size):
                out.append(("shared", start, start + size))
            case Each(start, size):
                out.append(("shared", start, start + call.copies * size))
            case Own(start, size):
                out.append(("own", start, start + call.copies * size))
            case Turned(start, size, rows):
                out.append(("own", start, start + rows * size))
            case Constants() | Worst():
                out.append(("", 0, 0))
    return out


def _range(index: np.ndarray[tuple[int, ...], np.dtype[np.intp]]) -> tuple[int, int]:
    """Return start and end of the range that indices cover."""
    return (int(index.min()), int(index.max()) + 1) if index.size else (0, 0)


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
        reads, writes = spans(step, 0), spans(step, 1)
        known = {"shared": shared, "result": result}
        for place, a, b in [*reads, *writes]:
            if place and not 0 <= a <= b <= room[place]:
                raise ValueError(f"{where}: {place} has no numbers {a}..{b}")
        for source, (place, a, b) in zip(step.sources, reads, strict=True):
            if isinstance(source, Result) and not result[source.index].all():
                raise ValueError(f"{where} reads a result that was not written")
            if place == "shared" and not shared[a:b].all():
                raise ValueError(f"{where} reads shared numbers {a}..{b} that were not written")
            rows = source.rows if isinstance(source, Turned) else step.copies
            if isinstance(source, Own | Turned) and own.get(source.start) != (source.size, rows):
                raise ValueError(f"{where} reads own numbers otherwise than they were written")
        for target, span in zip(step.targets, writes, strict=True):
            several = step.copies > 1 and isinstance(target, Shared | Add)
            if several and isinstance(target, Shared):
                raise ValueError(f"{where} writes shared numbers from {step.copies} copies")
            if several and any(overlap(span, read) for read in reads):
                raise ValueError(f"{where} reads what its copies add up")
            if isinstance(target, Own):
                own[target.start] = (target.size, step.copies)
            if isinstance(target, Result):
                result[target.index] = True
            elif span[0] in known:
                known[span[0]][span[1] : span[2]] = True
    if not result.all():
        raise ValueError(f"program '{program.name}': result {int(np.argmin(result))} is never written")


def _check_sizes(program: Program, call: Call, where: str) -> None:
    """Check that sources and targets have the sizes of the kernel."""
    f = program.kernels[call.kernel].function
    pairs = [(f.nnz_in(i), x) for i, x in enumerate(call.sources)] if f.n_in() == len(call.sources) else None
    if pairs is None or f.n_out() != len(call.targets):
        raise ValueError(f"{where} takes {f.n_in()} inputs and gives {f.n_out()} outputs")
    for size, end in [*pairs, *((f.nnz_out(i), x) for i, x in enumerate(call.targets))]:
        match end:
            case Given(index) | Result(index):
                shape: tuple[int, ...] = index.shape
            case Constants(values):
                shape = values.shape
            case Shared(_, n) | Add(_, n) | Each(_, n) | Own(_, n):
                shape = (call.copies, n)
            case Turned(_, n, rows, first):
                shape = (call.copies, rows) if first + call.copies <= n else ()
            case Worst():
                shape = (call.copies, 1)
        if shape != (call.copies, size):
            raise ValueError(f"{where}: {end} is not of shape {(call.copies, size)}")
