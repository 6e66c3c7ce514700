"""Check that both drivers of a program agree, and remove unused calls and kernels."""

from __future__ import annotations

from dataclasses import replace

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
