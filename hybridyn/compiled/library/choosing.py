"""Choose the code of single calls by measurement when a library is built; the cache keeps the choice.

All codes give the same bits, so the choice changes nothing but the time. The code is straight-line: its time
does not depend on the numbers, so random ones serve as a posture.
"""

from __future__ import annotations

import ctypes
import time
from pathlib import Path
from typing import Any

import numpy as np

from ..code.scalars import TYPES

#: Rounds of the measurement; each measures every code, and the least time of a code counts.
ROUNDS = 15
#: Time of a measurement [s]: much longer than reading the clock, so that all take some milliseconds.
LONG = 1e-4
#: Least time of a call [s] that counts are computed from: coarse clocks may not advance at all.
LEAST_CALL = 1e-7
#: Number of calls that show how many take that long.
WARMING = 30


def with_choices(path: Path, about: dict[str, Any]) -> dict[str, Any]:
    """Return the description of a library with the measured times of the codes of single calls.

    Args:
        path: The library; it is not a quick build.
        about: Description of its programs (`Source.about`).

    Returns:
        The same description; programs of several codes also have "times" [s], in their order.
    """
    programs = dict(about.get("programs", {}))
    if all(len(program["codes"]) == 1 for program in programs.values()):
        return about
    library = ctypes.PyDLL(str(path))
    for name, program in programs.items():
        if len(program["codes"]) > 1:
            programs[name] = program | {"times": _times(library, name, program, about["number"])}
    return about | {"programs": programs}


def use_choice(library: ctypes.CDLL, name: str, program: dict[str, Any]) -> None:
    """Let the single calls of a program use the fastest code.

    Args:
        library: The loaded library.
        name: Name of the program.
        program: Its description, as from `with_choices`.
    """
    if times := program.get("times"):
        ctypes.c_int.in_dll(library, f"{name}_code").value = times.index(min(times))


def _times(library: ctypes.CDLL, name: str, program: dict[str, Any], number: str) -> list[float]:
    """Measure each code of a program [s]; infinite for one whose results differ from those of the first."""
    dtype = np.dtype(number)
    generator = np.random.default_rng(1)
    given = generator.normal(size=sum(size for _, size in program["inputs"])).astype(dtype)
    out = np.zeros(sum(size for _, size in program["outputs"]), dtype)
    repeat = getattr(library, f"{name}_repeat")
    repeat.restype = {"double": ctypes.c_double, "float": ctypes.c_float}[TYPES[number][0]]
    repeat.argtypes = [ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_longlong]

    places = given.ctypes.data, out.ctypes.data

    def run(code: int, times: int) -> float:
        """Run a code some times, and return the processor time of a call [s]."""
        start = time.thread_time_ns()
        repeat(code, *places, times)
        return 1e-9 * (time.thread_time_ns() - start) / times

    least, results = [], []
    for code in range(len(program["codes"])):
        guard = repeat(code, *places, 1)
        results.append(np.append(out, guard))
        least.append(run(code, WARMING))
    many = int(LONG / max(min(least), LEAST_CALL)) + 1
    for _ in range(ROUNDS):
        least = [min(known, run(code, many)) for code, known in enumerate(least)]
    same = [np.array_equal(result, results[0], equal_nan=True) for result in results]
    return [seconds if equal else float("inf") for seconds, equal in zip(least, same, strict=True)]
