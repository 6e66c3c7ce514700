"""Which jobs are measured, in the short and in the full run, and how a finished job is remembered.

A job's rows are kept in `build/benchmarks/cache` under a fingerprint of the code, the versions and the
machine: a run that was stopped goes on where it was, and what did not change is not measured again.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks import (
    accuracy,
    callgrind,
    derivatives,
    losses,
    operations,
    programs,
    quantities,
    scaling,
    searches,
    shooting,
    simulation,
    singular,
    studies,
)
from benchmarks.cases import ROOT
from benchmarks.results import Row, machine
from benchmarks.timing import in_own_process
from hybridyn.studies.compare.methods import MODELS
from hybridyn.studies.compare.peer_engine import NotComparableError

CACHE = ROOT / "build" / "benchmarks" / "cache"
#: Files of this package that only show what was measured, or measure something else.
OUTPUT = {
    f"{name}.py"
    for name in (
        "report", "texts", "figures", "panels", "fronts", "goals", "descents", "__main__", "hard",
        "identification",
    )
}  # fmt: skip

SHIPPED = ("gough_stewart", "rps3", "five_bar", "delta", "tanev", "stewart_ur5", "scara_delta", "lx4")
STACKS = (1, 2, 4, 8, 16)
SNAKES = (4, 8, 16)
SIZES = {"stack": (1, 2, 4, 8, 16, 32, 64, 256), "snake": (4, 8, 16, 32, 64, 128)}
LONG: dict[str, tuple[float, ...]] = {
    "rk4": (), "projected": (1e-2, 1e-3), "general": (), "implicit": (), "mujoco": (1e-3, 2e-4),
}  # fmt: skip  # the general path would take a quarter of an hour for 10,000 steps
DISTANCES = tuple(10.0 ** (-k / 2) for k in range(17))


@dataclass(frozen=True)
class Task:
    """A job.

    Attributes:
        section: Section of the report.
        name: What it is about, unique in the section.
        function: Gives the rows.
        arguments: Its arguments.
    """

    section: str
    name: str
    function: Callable[..., list[Row]]
    arguments: tuple[Any, ...]


#: Section, function, arguments of each job, and whether it is run in a process of its own.
Jobs = list[tuple[str, Callable[..., list[Row]], list[tuple[Any, ...]], bool]]


def tasks_of(jobs: Jobs) -> list[Task]:
    """Return jobs with names: the words and numbers of their arguments."""
    out = []
    for section, function, many, apart in jobs:
        own = partial(in_own_process, function) if apart else function
        for arguments in many:
            name = " ".join(str(x) for x in arguments if isinstance(x, str | int))
            out.append(Task(section, name, own, arguments))
    return out


def short() -> list[Task]:
    """Return the jobs of the short run: nearly every section, in under a minute on two cores."""
    effort = accuracy.Effort(judged=2, batches=(1, 32), rounds=2, sweep=9)
    load = accuracy.Effort(2, (1, 32), (1, 2), rounds=1, looped=True)
    steps = {
        "rk4": (1e-2,), "compiled": (1e-2,), "peers": (1e-2,), "projected": (1e-2,), "rtol": (1e-3,),
        "general": (1e-3,), "conserving": (1e-2,), "implicit": (), "mujoco": (2e-3,),
    }  # fmt: skip
    few = {"rtol": (1e-5,), "rk4": (), "python": (), "mujoco": (1e-4,)}
    some = ("hybridyn, general", "pin.lcaba")
    jobs: Jobs = [
        ("ddm", accuracy.measure, [("ddm", "five_bar", effort)], True),
        ("idm", accuracy.measure, [("idm", "gough_stewart", effort)], True),
        ("scaling", scaling.measure, [("stack", n, 8, some) for n in (1, 2)], False),
        ("tools", scaling.tools, [(n, 2) for n in (1, 2)], True),
        ("simulation", simulation.measure, [("five_bar, let go, 1 s", steps, 0.1)], True),
        ("controlled", simulation.controlled, [(simulation.GOVERNOR, few, 0.1)], True),
        ("throughput", accuracy.measure, [("ddm", "five_bar", load)], True),
        ("derivatives", derivatives.measure, [("five_bar", 32, 2)], True),
        ("singular", singular.measure, [(name, (1.0, 1e-3)) for name in singular.APPROACHES], True),
        ("losses", losses.measure, [("five_bar", 32, 2)], True),
        ("cold", accuracy.cold, [("five_bar", 20)], True),
        ("programs", programs.measure, [("five_bar", 2_000)], True),
        ("quantities", quantities.measure, [("five_bar", 32, 1)], True),
    ]
    return tasks_of(jobs)


def full() -> list[Task]:
    """Return the jobs of the full run."""
    models: list[tuple[str, str, accuracy.Effort]] = []
    cases = [*SHIPPED, *(f"stack {n}" for n in STACKS if n != 4), *(f"snake {n}" for n in SNAKES), "ur5"]
    for case in cases:
        few = case in ("stack 16", "snake 16")
        effort = accuracy.Effort(judged=2 if few else 4, batches=(1, 500 if few else 1_000))
        models += [(model, case, effort) for model in MODELS]
    sizes = [(family, n, scaling.BATCH if n <= 64 else 100) for family in SIZES for n in SIZES[family]]
    flights = [(name, LONG if name == simulation.LONG else {}) for name in simulation.MOTIONS]
    batches = [(model, case, accuracy.BATCHES) for case in ("lx4", "five_bar") for model in MODELS]
    both = [(case, model) for case in ("gough_stewart", "lx4") for model in MODELS]
    jobs: Jobs = [
        *((model, accuracy.measure, [one for one in models if one[0] == model], True) for model in MODELS),
        ("scaling", scaling.measure, sizes, False),
        ("tools", scaling.tools, [(n,) for n in SIZES["stack"] if 4 <= n <= 64], True),
        ("simulation", simulation.measure, flights, True),
        ("controlled", simulation.controlled, [(name,) for name in simulation.SCENES], True),
        ("throughput", accuracy.measure, batches, True),
        ("derivatives", derivatives.measure, [(case, 100, 40) for case in derivatives.ROBOTS], True),
        ("singular", singular.measure, [(name, DISTANCES) for name in singular.APPROACHES], True),
        ("effects", studies.effects, [(case,) for case in studies.ROBOTS], True),
        ("losses", losses.measure, [(case,) for case in losses.ROBOTS], True),
        ("cold", accuracy.cold, [(case,) for case in accuracy.COLD_ROBOTS], True),
        ("callgrind", callgrind.measure, both, False),
        ("peak", operations.measure, [(case,) for case in ("gough_stewart", "lx4")], True),
        ("programs", programs.measure, [(case,) for case in programs.ROBOTS], False),
        ("quantities", quantities.measure, [(case,) for case in quantities.ROBOTS], True),
        ("sweeps", studies.sweeps, [(2, 48)], False),
        ("searches", searches.searches, [(k,) for k in range(searches.STARTS)], False),
        ("shooting", shooting.measure, [(name,) for name in shooting.MOTIONS], True),
    ]
    return tasks_of(jobs)


def fingerprint() -> str:
    """Return a hash of everything that a measurement depends on, the machine's load and the day apart."""
    digest = hashlib.sha256()
    folders = (ROOT / "hybridyn", ROOT / "benchmarks", ROOT / "urdf")
    for path in sorted(p for folder in folders for p in folder.rglob("*") if p.is_file()):
        if path.suffix in (".py", ".xacro", ".urdf", ".c", ".h") and not (
            path.parent.name == "benchmarks" and path.name in OUTPUT
        ):
            digest.update(path.relative_to(ROOT).as_posix().encode() + path.read_bytes())
    facts = {key: value for key, value in machine().items() if key not in ("commit", "date", "load before")}
    digest.update(repr(facts).encode())
    return digest.hexdigest()[:16]


@dataclass(frozen=True)
class Cache:
    """Finished jobs in a folder.

    Attributes:
        folder: The folder.
        print: The fingerprint that a job must have to count.
    """

    folder: Path
    print: str

    def path(self, task: Task) -> Path:
        """Return the file of a job; it depends on the job's arguments."""
        key = hashlib.sha256(repr((task.section, task.name, task.arguments)).encode()).hexdigest()[:12]
        return self.folder / f"{task.section}-{key}.json"

    def get(self, task: Task) -> tuple[list[Row], dict[str, str]] | None:
        """Return the rows and the machine of a finished job, None where there is none."""
        try:
            stored = json.loads(self.path(task).read_text())
        except (OSError, ValueError):
            return None
        if stored["print"] != self.print:
            return None
        return [Row(*values) for values in stored["rows"]], stored["machine"]

    def put(self, task: Task, rows: list[Row], facts: dict[str, str]) -> None:
        """Keep a finished job."""
        self.folder.mkdir(parents=True, exist_ok=True)
        stored = {"print": self.print, "machine": facts, "rows": rows}
        part = self.path(task).with_suffix(".part")
        part.write_text(json.dumps(stored))
        part.replace(self.path(task))

    def forget(self, tasks: list[Task]) -> None:
        """Remove finished jobs."""
        for task in tasks:
            self.path(task).unlink(missing_ok=True)


def measured(task: Task, cache: Cache | None) -> tuple[list[Row], dict[str, str], bool]:
    """Return a job's rows and machine, and whether they were remembered.

    Raises:
        WrongModelError: A model is wrong.
        NotComparableError: The job's process died.
    """
    if cache is not None and (found := cache.get(task)) is not None:
        return (*found, True)
    facts = machine()
    try:
        rows = task.function(*task.arguments)
    except NotComparableError as why:
        raise NotComparableError(f"{task.section}, {task.name}: {why}") from None
    if cache is not None:
        cache.put(task, rows, facts)
    return rows, facts, False
