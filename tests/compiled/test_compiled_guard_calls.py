"""The guard of a call is that of its own sample, and NaN is no guard that is passed."""

import sys
import threading

import casadi as ca
import numpy as np
import pytest

from hybridyn.compiled.code.scalars import GUARD_LIMIT
from hybridyn.compiled.library.calls import load
from hybridyn.compiled.program import Call, Given, Kernel, Program, Result, Worst
from hybridyn.compiled.programs.interpreter import function_of


def rooted(first: int) -> Program:
    """Return a program whose result is finite and whose guards are the roots of both inputs, in an order."""
    x = ca.SX.sym("x", 1)
    kernel = Kernel("root", ca.Function("root", [x], [1.0 + 0.0 * x * x, ca.sqrt(x)]), "module")
    calls = tuple(
        Call(0, 1, (Given(np.array([[k]])),), (Result(np.array([[k]])), Worst())) for k in (first, 1 - first)
    )
    return Program(f"rooted_{first}", (("x", 2),), (("one", 2),), (kernel,), calls, 0, 0)


@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize("x", [(-1.0, 0.25), (0.25, -1.0), (-1.0, -1.0)])
def test_a_guard_that_is_nan_fails_in_every_engine(first: int, x: tuple[float, float]) -> None:
    program = rooted(first)
    library = load([program])
    guards = [
        float(function_of(program)(np.array(x))[1]),
        library.single(program.name, np.array(x))[1],
        float(library.batch(program.name, np.array([x]))[1][0]),
        float(library.batch(program.name, np.array([x, x]))[1][1]),
    ]
    assert not any(guard <= GUARD_LIMIT for guard in guards)


def test_threads_do_not_read_each_others_guards() -> None:
    """Each thread calls with its own sample, while the others' guards are on the other side of the limit."""
    program = rooted(0)
    library, wrong = load([program]), []

    def call(x: float) -> None:
        given, guard = np.full(2, x), np.sqrt(x)
        for _ in range(4000):
            if library.single(program.name, given)[1] != guard:
                wrong.append(x)

    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    threads = [threading.Thread(target=call, args=(x,)) for x in (0.25, 4.0, 0.0625, 16.0)]
    try:
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    finally:
        sys.setswitchinterval(interval)
    assert not wrong
