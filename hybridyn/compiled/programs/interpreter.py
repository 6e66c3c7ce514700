"""Run a program in CasADi, and convert a program to one CasADi function."""

from __future__ import annotations

from functools import reduce
from typing import Any

import casadi as ca
import numpy as np

from ..program import Add, Call, Constants, Each, Given, Own, Program, Result, Shared, Start, Turned, Worst

#: Sums of results and guards above this are taken as infinite.
FINITE = 1e300


def function_of(program: Program) -> ca.Function:
    """Convert a program to one CasADi function, a flat graph.

    Returns:
        Function with the program's names of inputs and outputs, and the output "guard" last. As in C, the
        guard is above 1 where a result is not finite.
    """
    columns = [ca.SX.sym(name, size) for name, size in program.inputs]
    given = [
        column[i] for column, (_, size) in zip(columns, program.inputs, strict=True) for i in range(size)
    ]
    result, guards = run(program, given)
    ends = np.cumsum([0] + [size for _, size in program.outputs])
    outputs = [ca.vertcat(*result[ends[i] : ends[i + 1]]) for i in range(len(program.outputs))]
    total = ca.sum1(ca.vertcat(*result, *guards))
    guard = ca.if_else(ca.fabs(total) <= FINITE, reduce(ca.fmax, guards), np.inf)
    return ca.Function(
        program.name,
        columns,
        [*outputs, guard],
        [name for name, _ in program.inputs],
        [*(name for name, _ in program.outputs), "guard"],
    )


def run(program: Program, given: list[Any]) -> tuple[list[Any], list[Any]]:
    """Run a program on CasADi scalars; return its results, and the guards of which the largest counts."""
    shared: list[Any] = [None] * program.shared
    own: list[Any] = [None] * program.own
    result: list[Any] = [ca.SX(np.nan)] * sum(size for _, size in program.outputs)
    guards: list[Any] = [ca.SX(0.0)]
    for step in program.steps:
        if isinstance(step, Start):
            shared[step.start : step.start + len(step.values)] = [ca.SX(float(x)) for x in step.values]
            continue
        _call(program, step, given, result, shared, own, guards)
    return result, guards


def _call(
    program: Program, call: Call, given: list[Any], result: list[Any], shared: list[Any], own: list[Any],
    guards: list[Any],
) -> None:  # fmt: skip
    """Run one call, and append its guards."""
    function = program.kernels[call.kernel].function
    for i in range(call.copies):
        arguments = []
        for source in call.sources:
            match source:
                case Given(index):
                    values = [given[j] for j in index[i]]
                case Result(index):
                    values = [result[j] for j in index[i]]
                case Constants(numbers):
                    values = [ca.SX(float(x)) for x in numbers[i]]
                case Shared(start, size):
                    values = shared[start : start + size]
                case Each(start, size):
                    values = shared[start + i * size : start + (i + 1) * size]
                case Own(start, size):
                    values = own[start + i * size : start + (i + 1) * size]
                case Turned():
                    values = [own[j] for j in source.index(i)]
            arguments.append(ca.vertcat(*values) if values else ca.SX(0, 1))
        outputs = function.call(arguments)
        for target, output in zip(call.targets, outputs, strict=True):
            values = [output[j] for j in range(output.numel())]
            match target:
                case Result(index):
                    for j, value in zip(index[i], values, strict=True):
                        result[j] = value
                case Shared(start, size):
                    shared[start : start + size] = values
                case Each(start, size):
                    shared[start + i * size : start + (i + 1) * size] = values
                case Own(start, size):
                    own[start + i * size : start + (i + 1) * size] = values
                case Add(start, _):
                    for j, value in enumerate(values):
                        shared[start + j] = shared[start + j] + value
                case Worst():
                    guards.append(values[0])
