"""Results as rows of CSV files, one file a section, and the machine and the day of each measurement."""

from __future__ import annotations

import csv
import os
import platform
import subprocess
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, NamedTuple, get_type_hints

NAN = float("nan")
PACKAGES = ("hybridyn", "pin", "numpy", "scipy", "mujoco", "casadi")
#: The sections and what their files hold, in the order in which they are measured.
SECTIONS = {
    "ddm": "direct model: every method at every setting",
    "idm": "inverse model: every method at every setting",
    "scaling": "time and memory against the number of modules",
    "tools": "a tool's pose through a number of modules, by the general path",
    "simulation": "time integration: error of the final state, energy and closures",
    "controlled": "scenes: processor time of a simulated second",
    "throughput": "size of batches and number of threads",
    "derivatives": "derivatives of both models",
    "singular": "errors close to singular postures",
    "effects": "what each effect changes along the robot's own motion, and its operations",
    "losses": "losses that grow with load in compiled models, over these without",
    "cold": "single calls after other memory was touched",
    "callgrind": "instructions per sample",
    "peak": "share of the rate of one core",
    "programs": "what a program waits for around the models; loops closed in C; the command line",
    "quantities": "mass matrices and their like, beside those of Pinocchio's open tree",
    "sweeps": "sweeps of designs",
    "searches": "what searches for a design reach by work, with gradients and without",
    "shooting": "iterations of DDP on a leg with a parallel ankle, with second derivatives and without",
}
#: The error that the speed goals ask of everybody.
GOOD = 1e-10
#: What a row compares before anything is timed.
CHECK = "check"


class Row(NamedTuple):
    """A line of a table of results; what a section does not measure is empty or NaN.

    Attributes:
        case: Robot, scene or family of robots.
        model: What is computed: "ddm", "idm", "ddm_jacobian", a program; `CHECK` for a comparison before
            anything is timed.
        method: Who computes it.
        setting: Setting, or what of it is measured, in words.
        at: Number of modules or of designs, work in designs, iteration, or distance from the singular
            posture [rad].
        batch: Samples per call, rows of a table or postures of a design.
        threads: Threads, cores or processes used.
        error: Relative error against the reference, the worst of some states or that of a final state.
        limit: What the error may be.
        us: Least time per sample [us].
        median: Median time per sample [us].
        seconds: Least time of a run, or of a simulated second [s].
        mib: What the process grew by, or held, at its peak [MiB].
        energy: Largest change of the energy over the largest kinetic energy.
        closure: Largest closure residual relative to the module's length.
        operations: Operations over those of what it is compared with.
        iterations: Steps of an iteration in each sample, or until a solution.
        value: Another number.
        unit: Its unit, empty for a ratio of like things.
        note: Why it was not measured, or how it ended.
    """

    case: str
    model: str = ""
    method: str = ""
    setting: str = ""
    at: float = NAN
    batch: int = 1
    threads: int = 1
    error: float = NAN
    limit: float = NAN
    us: float = NAN
    median: float = NAN
    seconds: float = NAN
    mib: float = NAN
    energy: float = NAN
    closure: float = NAN
    operations: float = NAN
    iterations: float = NAN
    value: float = NAN
    unit: str = ""
    note: str = ""


def write_rows(path: Path, rows: Sequence[Row]) -> None:
    """Write rows, numbers with six digits, without the columns that say nothing."""
    said = [
        name
        for name, nothing in Row._field_defaults.items()
        if any(repr(getattr(row, name)) != repr(nothing) for row in rows)
    ]
    names = ["case", *said]
    cells = ([getattr(row, name) for name in names] for row in rows)
    write_table(path, names, ([f"{x:.6g}" if isinstance(x, float) else x for x in line] for line in cells))


def read_rows(path: Path) -> list[Row]:
    """Read rows back, none where there is no file."""
    types = get_type_hints(Row)
    return [Row(**{name: types[name](text) for name, text in line.items()}) for line in read_table(path)]


def write_table(path: Path, header: Sequence[str], rows: Iterable[Sequence[Any]]) -> None:
    """Write a CSV file, and the folder that it lies in."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows([header, *rows])


def read_table(path: Path) -> list[dict[str, str]]:
    """Read a CSV file, nothing where there is none."""
    if not path.exists():
        return []
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def machine() -> dict[str, str]:
    """Describe the machine and the versions, and tell the day of the run (UTC)."""
    facts = {
        "processor": _processor(),
        "cores": str(os.cpu_count()),
        "load before": f"{os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else "unknown",
        "system": f"{platform.system()} {platform.machine()}",
        "Python": platform.python_version(),
    }
    for package in PACKAGES:
        try:
            facts[package] = version(package)
        except PackageNotFoundError:
            facts[package] = "from this folder" if package == "hybridyn" else "not installed"
    facts["compiler"] = _first_line(["cc", "--version"])
    facts["commit"] = _first_line(["git", "describe", "--always", "--dirty"])
    facts["date"] = today()
    return facts


def today() -> str:
    """Return the day of a run (UTC)."""
    return datetime.now(UTC).date().isoformat()


def measured_on(machines: dict[str, dict[str, str]], sections: Iterable[str]) -> str:
    """Say on which day and machine the rows of some sections were measured."""
    where: dict[str, list[str]] = {}
    for section in sections:
        facts = machines.get(section, {})
        known = "processor" in facts
        on = f"{facts['processor']}, {facts['cores']} cores" if known else "machine not recorded"
        where.setdefault(f"{facts.get('date', 'day not recorded')}, {on}", []).append(section)
    return "; ".join(f"{', '.join(names)}: {said}" for said, names in where.items())


def write_machines(path: Path, machines: dict[str, dict[str, str]]) -> None:
    """Write the description of the machine of each section."""
    rows = [(section, *fact) for section, facts in machines.items() for fact in facts.items()]
    write_table(path, ("section", "fact", "value"), rows)


def read_machines(path: Path) -> dict[str, dict[str, str]]:
    """Read them back."""
    out: dict[str, dict[str, str]] = {}
    for row in read_table(path):
        out.setdefault(row["section"], {})[row["fact"]] = row["value"]
    return out


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    named = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(named, platform.processor() or "unknown")


def _first_line(words: list[str]) -> str:
    try:
        done = subprocess.run(words, capture_output=True, text=True, cwd=Path(__file__).parent)
    except OSError:
        return "none"
    return (done.stdout.splitlines() or ["unknown"])[0]
