"""Programs without what does nothing: calls that write nothing, kernels that nobody calls."""

from __future__ import annotations

from dataclasses import replace

from ..program import Call, Program, Start


def trimmed(program: Program) -> Program:
    """Return a program without calls whose outputs are all empty, and without kernels that are not called."""
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
