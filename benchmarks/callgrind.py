"""Instructions per call, counted by valgrind's callgrind: repeatable on a noisy machine.

A Python process loads the robot, calls each method a few times, has counting switched on from outside
(`callgrind_control`), and goes on. So the counts are those of a user's call, Python included; those inside
libraries that were compiled for one robot are given apart.
"""

from __future__ import annotations

import math
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from benchmarks.cases import ROOT, case_of
from benchmarks.methods import Model, NotMeasuredError, Setting
from benchmarks.peers import METHODS, compiled
from benchmarks.results import Count
from benchmarks.scaling import SETTINGS
from hybridyn.spatial import Array

CALLS = 20
NOTHING = "nothing"
PATIENCE = 900  # for one process [s]


def measure(case: str, model: Model) -> list[Count]:
    """Count every method of a model on one robot, one sample per call."""
    out = []
    try:
        idle = counted(case, model, NOTHING, {})[0]
    except NotMeasuredError as why:
        return [Count(case, model, "every method", math.nan, str(why))]
    for method in METHODS:
        if method.model != model or method.name in ("pin.aba", "pin.rnea", compiled.SINGLE):
            continue
        try:
            total, own = counted(case, model, method.name, SETTINGS.get(method.name, {}))
            out.append(Count(case, model, method.name, total - idle, ""))
            if own:
                out.append(Count(case, model, f"{method.name}, in its own library", own, ""))
        except NotMeasuredError as why:
            out.append(Count(case, model, method.name, math.nan, str(why)))
    return out


def counted(case: str, model: Model, method: str, setting: Setting) -> tuple[float, float]:
    """Give the instructions of one call, and those of them in a library made for the robot.

    Raises:
        NotMeasuredError: There is no valgrind, the method cannot do the robot, or the process died.
    """
    if shutil.which("valgrind") is None or shutil.which("callgrind_control") is None:
        raise NotMeasuredError("valgrind is not installed")
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "counts"
        words = ["valgrind", "--tool=callgrind", "--instr-atstart=no", f"--callgrind-out-file={target}", "-q"]
        words += [sys.executable, "-m", "benchmarks.callgrind", case, model, method]
        words += [f"{name}={value!r}" for name, value in setting.items()]
        environment = {
            **os.environ,
            "PYTHONHASHSEED": "0",
            "OMP_NUM_THREADS": "1",
            "OPENBLAS_NUM_THREADS": "1",
        }
        try:
            done = subprocess.run(
                words, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=PATIENCE
            )
        except subprocess.TimeoutExpired:
            raise NotMeasuredError(f"given up after {PATIENCE} s") from None
        said = done.stdout.strip().splitlines()
        if done.returncode:
            why = (
                said[-1] if said and said[-1].startswith("not measured: ") else "the process died in valgrind"
            )
            raise NotMeasuredError(why.removeprefix("not measured: "))
        costs = by_library(target.read_text())
    return sum(costs.values()) / CALLS, sum(
        cost for name, cost in costs.items() if compiled_here(name)
    ) / CALLS


def compiled_here(library: str) -> bool:
    """Tell whether a library was compiled for a robot: it lies in hybridyn's cache."""
    return "hybridyn" in library and library.endswith(".so")


def by_library(text: str) -> dict[str, float]:
    """Sum the self cost in a callgrind file by object."""
    names: dict[str, str] = {}
    costs: dict[str, float] = {}
    here, called = "", False
    for line in text.splitlines():
        if line.startswith("ob="):
            number, _, name = line[3:].partition(" ")
            here = names.setdefault(number, name) if name else names.get(number, number)
        elif line.startswith("cob="):
            number, _, name = line[4:].partition(" ")
            if name:
                names.setdefault(number, name)
        elif line.startswith("calls="):
            called = True  # the next line holds what the callee cost
        elif line[:1].isdigit() or line[:1] in "+-*":
            if not called and len(words := line.split()) == 2:
                costs[here] = costs.get(here, 0.0) + float(words[1])
            called = False
    return costs


def main(case: str, model: str, name: str, *options: str) -> int:
    """Be the process that is counted; gives the exit status."""
    import hybridyn

    setting = {key: float(value) for key, value in (option.split("=") for option in options)}
    own = case_of(case)
    robot = own.load()
    q, v, a = own.states(robot, CALLS)
    given = a if model == "idm" else hybridyn.idm(robot, q, v, a)
    method = next((m for m in METHODS if (m.model, m.name) == (model, name)), None)
    try:
        solve = method.prepare(robot)(setting) if method else nothing
    except NotMeasuredError as why:
        print(f"not measured: {why}")
        return 1
    states = list(zip(q, v, given, strict=True))
    for state in states:
        solve(*state)
    for _ in switched_on():
        for state in states:
            solve(*state)
    return 0


def nothing(q: Array, v: Array, given: Array) -> Array:
    """Do nothing: what switching the counting costs is taken off the other counts."""
    return given


def switched_on() -> Iterator[None]:
    """Count while the body runs."""
    for word in ("on", "off"):
        subprocess.run(["callgrind_control", "-i", word, str(os.getpid())], capture_output=True, check=True)
        if word == "on":
            yield


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
