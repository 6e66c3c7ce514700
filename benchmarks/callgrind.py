"""Instructions per sample, counted by valgrind's callgrind: repeatable on a noisy machine.

A Python process loads the robot and warms a method up; counting is on while it is called again. So the counts
are those of a user's call, Python included; those inside the library that was compiled for the robot are
given apart. Valgrind knows no AVX-512: there, compiled models are written for four lanes of AVX2.
"""

from __future__ import annotations

import ctypes
import gc
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from unittest.mock import patch

import numpy as np

from benchmarks.accuracy import SETTINGS as OTHERS
from benchmarks.cases import ROOT, case_of
from benchmarks.peers import methods_of, ours, rk4
from benchmarks.results import Row
from benchmarks.timing import ONE_THREAD
from hybridyn.compiled.library import building
from hybridyn.description.cache_folder import folder as cache_folder
from hybridyn.errors import CompileError
from hybridyn.studies.compare.methods import Method, Model, written
from hybridyn.studies.compare.peer_engine import NotComparableError

#: Samples of one call in a batch, and in a row of single ones: a tenth of them.
BATCH = 200
#: For one process [s].
PATIENCE = 300
REASON = "not measured: "
#: Robots with loops alone are counted; the oracle takes minutes in valgrind.
LEFT_OUT = (ours.SINGLE, ours.ORACLE, "pin.aba", "pin.rnea")

#: One setting for each peer that is swept: the fastest that is good to 1e-10.
SETTINGS = {
    **OTHERS,
    **{f"pin.{name}": {"mu": mu, "iterations": count} for name, (mu, count) in rk4.SOLVERS.items()},
}

SWITCH = """\
#include <valgrind/callgrind.h>
void counting_on(void) { CALLGRIND_START_INSTRUMENTATION; }
void counting_off(void) { CALLGRIND_STOP_INSTRUMENTATION; }
"""


def measure(case: str, model: Model) -> list[Row]:
    """Count every method of a model on one robot: one sample per call, the compiled one in a batch too."""
    methods = [method for method in methods_of(model) if method.name not in LEFT_OUT]
    jobs = [(method, 1) for method in methods]
    jobs += [(method, BATCH) for method in methods if method.name == ours.COMPILED]
    with tempfile.TemporaryDirectory() as name, ThreadPoolExecutor(os.cpu_count()) as pool:
        folder = Path(name)
        try:
            prepare(case, model, folder)
        except NotComparableError as why:
            return [Row(case, model, "every method", note=str(why))]
        found = pool.map(lambda job: list(_rows(case, job[0], job[1], folder)), jobs)
        return [row for rows in found for row in rows]


def _rows(case: str, method: Method, batch: int, folder: Path) -> Iterator[Row]:
    """Count one method, or say why not."""
    row = Row(case, method.model, method.name, written(SETTINGS.get(method.name, {})), batch=batch)
    try:
        total, own = counted(case, method, batch, folder)
    except NotComparableError as why:
        yield row._replace(note=str(why))
        return
    yield row._replace(value=total, unit="instructions")
    if own:
        yield row._replace(value=own, unit="instructions in its own library")


def prepare(case: str, model: Model, folder: Path) -> None:
    """Write states, build the switch, and the compiled model: nothing is compiled within valgrind.

    Raises:
        NotComparableError: There is no valgrind, or no compiler.
    """
    if shutil.which("valgrind") is None:
        raise NotComparableError("valgrind is not installed")
    try:
        compiler = building.find_compiler()
        source, target = folder / "switch.c", folder / "switch.so"
        source.write_text(SWITCH)
        subprocess.run(
            [*compiler, "-shared", "-fPIC", str(source), "-o", str(target)],
            check=True,
            capture_output=True,
        )
    except (CompileError, subprocess.CalledProcessError):
        raise NotComparableError("no C compiler that finds valgrind/callgrind.h") from None
    _process([], [case, model, "", str(BATCH), str(folder)])


def counted(case: str, method: Method, batch: int, folder: Path) -> tuple[float, float]:
    """Return the instructions per sample, and those of them in the library made for the robot.

    Raises:
        NotComparableError: The method cannot do the robot, or the process died.
    """
    target = folder / f"{method.name}, {batch}"
    tool = ["valgrind", "--tool=callgrind", "--instr-atstart=no", f"--callgrind-out-file={target}", "-q"]
    _process(tool, [case, method.model, method.name, str(batch), str(folder)])
    costs = by_library(target.read_text())
    if not costs:
        raise NotComparableError("valgrind counted nothing")
    samples, own = (BATCH if batch > 1 else BATCH // 10), str(cache_folder().resolve())
    inside = sum(cost for name, cost in costs.items() if name.startswith(own))
    return sum(costs.values()) / samples, inside / samples


def _process(tool: list[str], words: list[str]) -> None:
    """Run `main` in a process, within a tool or not.

    Raises:
        NotComparableError: It failed, or took too long.
    """
    environment = {**os.environ, **dict.fromkeys(ONE_THREAD, "1"), "PYTHONHASHSEED": "0"}
    if "avx512f" in building.features():  # vectors that valgrind does not know
        environment["CC"] = shlex.join([*building.find_compiler(), "-mno-avx512f"])
    command = [*tool, sys.executable, "-m", "benchmarks.callgrind", *words]
    try:
        done = subprocess.run(
            command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=PATIENCE
        )
    except subprocess.TimeoutExpired:
        raise NotComparableError(f"given up after {PATIENCE} s") from None
    if done.returncode:
        said = [line for line in done.stdout.splitlines() if line.startswith(REASON)]
        why = said[-1].removeprefix(REASON) if said else f"the process died (exit status {done.returncode})"
        raise NotComparableError(why)


def by_library(text: str) -> dict[str, float]:
    """Sum the self cost in a callgrind file by object."""
    names: dict[str, str] = {}
    costs: dict[str, float] = {}
    here, called = "", False
    for line in text.splitlines():
        if found := re.match(r"(c?)ob=(\S+) ?(.*)", line):
            name = names.setdefault(found[2], found[3] or found[2])
            here = here if found[1] else name
        elif found := re.match(r"[\d+*-]\S* (\d+)$", line):
            costs[here] = costs.get(here, 0.0) + (0.0 if called else float(found[1]))
        called = line.startswith("calls=")  # the next line holds what the callee cost
    return {name: cost for name, cost in costs.items() if cost}


def main(case: str, model: Model, name: str, batch: str, folder: str) -> int:
    """Be the process that is counted, or without a method the one that prepares; gives the exit status."""
    import hybridyn

    robot, path = case_of(case).load(), Path(folder, "states.npz")
    with patch.object(building, "features", lambda: frozenset({"avx", "avx2", "fma"})):
        if not name:
            q, v, a = case_of(case).states(robot, BATCH)
            np.savez(path, q=q, v=v, given=a if model == "idm" else hybridyn.idm(robot, q, v, a))
        method = next(m for m in methods_of(model) if m.name == (name or ours.COMPILED))
        try:
            solve = method.prepare(robot)(SETTINGS.get(name, {}))
        except NotComparableError as why:
            print(f"{REASON}{why}")
            return 1 if name else 0
    with np.load(path) as file:
        arrays = [file[key] for key in ("q", "v", "given")]
    calls = [arrays] if int(batch) > 1 else [[x[i].copy() for x in arrays] for i in range(BATCH // 10)]
    switch = ctypes.CDLL(str(Path(folder, "switch.so")))
    gc.disable()
    for call in calls:
        solve(*call)
    switch.counting_on()
    for call in calls:
        solve(*call)
    switch.counting_off()
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))  # type: ignore[arg-type]
