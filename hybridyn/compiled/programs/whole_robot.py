"""Build all models of one robot as programs; run a program in CasADi, and convert it to one function."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial, reduce
from threading import Lock
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from ...effects.choice import Choice
from ...spatial import Array
from ...structure.parameters.slots import Slot
from ...structure.robot import HybridRobot
from ..code.scalars import GUARD_LIMIT
from ..equations.request import Request, request
from ..program import Call, Constants, Program, Start, Worst, stored
from .close import close_program, lift_program
from .direct import direct_program
from .inverse import inverse_program
from .kinematics import kinematics_program


def programs(
    robot: HybridRobot,
    effects: Choice = None,
    *,
    models: tuple[str, ...] = ("idm", "ddm", "kinematics", "lift"),
    parameters: Sequence[Slot] = (),
    dtype: str = "float64",
    wrenches: Sequence[str] = (),
) -> dict[str, Program]:
    """Build a robot's models as programs.

    Args:
        effects: Effects to include, as for `hybridyn.idm`.
        models: Names of the models: "idm", "ddm", "kinematics"; "lift", a Newton step onto the assembled
            postures, left out if the robot has no such program; "close", the motion of all joints from the
            motors'; "idm_pushed" and "ddm_pushed", those of a floating robot under a wrench on its base.
        parameters: Numbers of the description that are an input ("parameters"). "lift" is then left out.
        dtype: Type of the arithmetic, "float64" or "float32". The general path computes samples whose loops
            are open by more than its rounding.
        wrenches: Links on which the models of forces take wrenches ("wrenches", six numbers of each).

    Raises:
        ModelError: An effect is not available in compiled models, or no wrench can act on a link.
    """
    asked = request(robot, effects, parameters=parameters, dtype=dtype, wrenches=wrenches, contacts=True)
    return programs_of(asked, models)


def programs_of(asked: Request, models: tuple[str, ...]) -> dict[str, Program]:
    """Build models of what is asked for, see `programs`."""
    write: dict[str, Callable[[Request], Program | None]] = {
        "idm": inverse_program,
        "ddm": direct_program,
        "idm_pushed": partial(inverse_program, pushed=True),
        "ddm_pushed": partial(direct_program, pushed=True),
        "kinematics": kinematics_program,
        "lift": lift_program,
        "close": close_program,
    }
    if asked.arguments is not None:
        models = tuple(name for name in models if name in ("idm", "ddm", "kinematics", "close"))
    written = {name: write[name](asked) for name in models}
    return {name: program for name, program in written.items() if program is not None}


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
    outputs = [ca.vertcat(*result[at : at + size]) for _, size, at in stored(program.outputs)]
    total = ca.sum1(ca.vertcat(*result, *guards))
    guard = ca.if_else(ca.fabs(total) <= FINITE, reduce(ca.fmax, guards), np.inf)
    return ca.Function(
        program.name,
        columns,
        [*outputs, guard],
        [name for name, _ in program.inputs],
        [*(name for name, _ in program.outputs), "guard"],
    )


class InterpretedCalls:
    """A program that CasADi runs, called like one of a `Library`; no C can call it.

    Attributes:
        inputs, outputs: Name and length of each.
        dtype: Type of the results; CasADi computes in double precision.
        trusted: Largest guard of a result that can be trusted.
        at_once, address: That there is no function in C.
    """

    at_once, address = None, 0

    def __init__(self, program: Program, dtype: np.dtype[Any]) -> None:
        self.inputs, self.outputs = list(program.inputs), list(program.outputs)
        self.dtype, self.trusted = dtype, GUARD_LIMIT
        self._given = [np.zeros(size) for _, size in self.inputs]
        self._found = [np.zeros(size) for size in [*(size for _, size in self.outputs), 1]]
        self._buffer, self._run = function_of(program).buffer()
        for i, x in enumerate(self._given):
            self._buffer.set_arg(i, memoryview(x))  # type: ignore[arg-type, call-arg]
        for i, x in enumerate(self._found):
            self._buffer.set_res(i, memoryview(x))  # type: ignore[arg-type, call-arg]
        self._alone = Lock()  # calls share these arrays

    def batch(self, inputs: Sequence[Array], threads: int) -> tuple[tuple[NDArray[Any], ...], NDArray[Any]]:
        """Run many samples, one after the other, in one thread.

        Args:
            inputs: Inputs, shapes (T, n).

        Returns:
            Outputs, shapes (T, n), and guards, shape (T,).
        """
        new = [np.empty((len(inputs[0]), len(x)), self.dtype) for x in self._found]
        with self._alone:
            for t, row in enumerate(zip(*inputs, strict=True)):
                for own, x in zip(self._given, row, strict=True):
                    own[:] = x
                self._run()
                for out, x in zip(new, self._found, strict=True):
                    out[t] = x
        return tuple(new[:-1]), new[-1][:, 0]


class Interpreted:
    """Programs that CasADi runs, called like those of a `Library`: slow, and without a compiler.

    Attributes:
        programs: The programs by name.
        dtype: Type for which their guards are made, and of the results.
    """

    def __init__(self, programs: Sequence[Program], dtype: str = "float64") -> None:
        self.dtype = np.dtype(dtype)
        self.programs = {program.name: InterpretedCalls(program, self.dtype) for program in programs}

    def batch(self, name: str, *inputs: Array) -> tuple[tuple[Array, ...], Array]:
        """Run a program sample after sample; return outputs, shapes (T, n), and guards, shape (T,)."""
        return self.programs[name].batch(inputs, 1)


def run(program: Program, given: list[Any]) -> tuple[list[Any], list[Any]]:
    """Run a program on CasADi scalars; return its results, and the guards of which the largest counts."""
    result: list[Any] = [ca.SX(np.nan)] * sum(size for _, size in program.outputs)
    memory = {
        "given": given,
        "result": result,
        "shared": [None] * program.shared,
        "own": [None] * program.own,
    }
    guards: list[Any] = [ca.SX(0.0)]
    for step in program.steps:
        if isinstance(step, Start):
            end = step.start + len(step.values)
            memory["shared"][step.start : end] = [ca.SX(float(x)) for x in step.values]
        else:
            _call(program.kernels[step.kernel].function, step, memory, guards)
    return result, guards


def _call(function: ca.Function, call: Call, memory: dict[str, list[Any]], guards: list[Any]) -> None:
    """Run one call, and append its guards."""
    reads, writes = ([end.at(call.copies).tolist() for end in ends] for ends in (call.sources, call.targets))
    for i in range(call.copies):
        arguments = []
        for source, at in zip(call.sources, reads, strict=True):
            if isinstance(source, Constants):
                values = [ca.SX(float(x)) for x in source.values[i]]
            else:
                values = [memory[source.memory][j] for j in at[i]]
            arguments.append(ca.vertcat(*values) if values else ca.SX(0, 1))
        outputs = function.call(arguments)
        for target, at, output in zip(call.targets, writes, outputs, strict=True):
            values = [output[j] for j in range(output.numel())]
            if isinstance(target, Worst):
                guards += values
                continue
            place = memory[target.memory]
            for j, value in zip(at[i], values, strict=True):
                place[j] = place[j] + value if target.adds else value
