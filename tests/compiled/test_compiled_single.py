"""The codes of single calls: the same bits as a batch, chosen by measurement, kept in the cache, printed."""

import ctypes
from dataclasses import replace
from itertools import accumulate, count
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hybridyn.compiled.code import alone
from hybridyn.compiled.code.alone import lanes_of_codes
from hybridyn.compiled.code.library_source import library_source
from hybridyn.compiled.code.scalars import Scalar
from hybridyn.compiled.library import choosing
from hybridyn.compiled.library.cache import cached
from hybridyn.compiled.library.calls import Library
from hybridyn.compiled.program import Program
from tests.compiled_toys import inputs, single, toy

SAMPLES = 5


def program_of(copies: int) -> Program:
    """Return a toy that is called like a model whose single calls matter."""
    return replace(toy(3, copies), name="idm")


@pytest.mark.parametrize(
    ("program", "statements", "lanes", "codes"),
    [
        (program_of(1), 10, 8, [8, 1]), (program_of(6), 10, 8, [8, 4]), (program_of(6), 10, 4, [4]),
        (program_of(1), 10, 4, [4, 1]), (program_of(1), 10, 1, [1]), (program_of(1), 10_000, 8, [8]),
        (toy(3, 1), 10, 8, [8]),
    ],
)  # fmt: skip
def test_copies_and_statements_decide_which_codes_are_built(
    program: Program, statements: int, lanes: int, codes: list[int]
) -> None:
    assert lanes_of_codes(program, [statements] * len(program.kernels), lanes) == codes


@pytest.mark.parametrize(
    "number", ["float64", pytest.param("float32", marks=pytest.mark.slow)]
)  # the other widths
def test_every_code_of_single_calls_gives_the_bits_of_a_batch(
    number: str, empty_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(alone, "VECTOR_STATEMENT", np.inf)  # build all
    readings = accumulate(10**9 // n for n in count(1))  # each measurement is shorter than the one before
    monkeypatch.setattr(choosing, "time", SimpleNamespace(thread_time_ns=readings.__next__))
    program, lanes = program_of(3), {"float64": 8, "float32": 16}[number]
    source = library_source([program], Scalar(number, lanes))
    built = cached("single", lambda: source)
    about = built.about["programs"]["idm"]
    assert about["codes"] == [lanes, lanes // 2, 1]
    assert all(0 < seconds < np.inf for seconds in about["times"])
    assert cached("single", lambda: source).about == built.about  # the choice is made once
    library = Library(built)
    code = ctypes.c_int.in_dll(ctypes.PyDLL(str(built.path)), "idm_code")
    assert code.value == 2
    assert about["times"][2] == min(about["times"])
    given = [x.astype(number) for x in inputs(program, SAMPLES)]
    parts, guard = library.batch("idm", *given)
    for n in range(len(about["codes"])):
        code.value = n
        for t in range(SAMPLES):
            found, worst = single(library, "idm", *(x[t] for x in given))
            assert all((one == many[t]).all() for one, many in zip(found, parts, strict=True))
            assert worst == guard[t]
    quick = cached("single", lambda: source, quick=True)
    assert quick.about == built.about  # found in the cache


def test_clocks_that_stand_still_measure_nothing_and_other_results_are_never_chosen(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    calls = []

    def repeat(code: int, given: int, out: int, times: int) -> float:
        """Return the guard, which the last code computes otherwise."""
        calls.append(times)
        return float(code == 2)

    monkeypatch.setattr(choosing.time, "thread_time_ns", lambda: 0)
    program = {"inputs": [("q", 2)], "outputs": [("tau", 2)], "codes": [8, 4, 1]}
    library: Any = SimpleNamespace(idm_repeat=repeat)
    assert choosing._times(library, "idm", program, "float64") == [0.0, 0.0, np.inf]
    assert max(calls) <= 1001


def test_quick_builds_have_the_code_of_batches_alone(empty_cache: Path) -> None:
    program = program_of(1)
    source = library_source([program], Scalar("float64", 4))
    built = cached("single", lambda: source, quick=True)
    assert built.quick
    assert "times" not in built.about["programs"]["idm"]
    assert not hasattr(ctypes.PyDLL(str(built.path)), "idm_repeat")
    given = inputs(program, 1)
    library = Library(built)
    found, _ = single(library, "idm", *(x[0] for x in given))
    assert all((x == y[0]).all() for x, y in zip(found, library.batch("idm", *given)[0], strict=True))
