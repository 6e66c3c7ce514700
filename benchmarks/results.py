"""Results as rows of CSV files, one file a section, and the machine that each was measured on."""

from __future__ import annotations

import csv
import os
import platform
import subprocess
from collections.abc import Iterable, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, NamedTuple, get_type_hints

PACKAGES = ("hybridyn", "pin", "numpy", "scipy", "mujoco", "casadi")


class Check(NamedTuple):
    """A model against its reference, before anything is timed.

    Attributes:
        case: Robot.
        what: What was compared.
        error: Largest difference relative to the largest entry.
        limit: What it may be; NaN where it is only stated.
        section: The section that it opens.
    """

    case: str
    what: str
    error: float
    limit: float
    section: str = ""


class Point(NamedTuple):
    """A method at a setting on a robot: error and time.

    Attributes:
        model: "ddm" or "idm"; "ddm_jacobian" or "idm_jacobian" for their derivatives.
        case: Robot.
        method: Method.
        setting: Setting, in words.
        batch: Samples per call.
        threads: Threads used.
        error: Worst relative error against the reference.
        us: Least time per sample [us].
        median: Median time per sample [us].
        note: Why it was not measured, else empty.
    """

    model: str
    case: str
    method: str
    setting: str
    batch: int
    threads: int
    error: float
    us: float
    median: float
    note: str


class Size(NamedTuple):
    """Cost at a number of modules.

    Attributes:
        family: "stack" or "snake".
        modules: Number of modules.
        model: "ddm", "idm", "assemble" or "load".
        method: Method, its setting in words.
        batch: Samples per call.
        us: Time per sample [us].
        mib: What the process grew by at its peak [MiB].
        note: Why it was not measured, else empty.
    """

    family: str
    modules: int
    model: str
    method: str
    batch: int
    us: float
    mib: float
    note: str


class Flight(NamedTuple):
    """A simulation.

    Attributes:
        case: Robot and motion.
        method: Integrator and model.
        setting: Step, tolerance, stabilisation.
        seconds: Wall time.
        state: Error of the final state, the largest over its joints (rad, m, per second).
        energy: Largest change of the energy over the largest kinetic energy.
        closure: Largest closure residual relative to the module's length.
        note: Why it was not measured, or how it ended.
    """

    case: str
    method: str
    setting: str
    seconds: float
    state: float
    energy: float
    closure: float
    note: str


class Controlled(NamedTuple):
    """A run of a scene.

    Attributes:
        case: Scene.
        method: Integrator and model.
        setting: Step or tolerance.
        per_second: Processor time per simulated second [s].
        steps: Steps taken.
        error: Error of the final state, relative to the way and to the largest rate.
        note: Why it was not measured, or how it ended.
    """

    case: str
    method: str
    setting: str
    per_second: float
    steps: int
    error: float
    note: str


class Near(NamedTuple):
    """Error close to a singular posture.

    Attributes:
        case: Robot and singularity.
        distance: From the singular posture [rad].
        method: Method.
        setting: Setting, in words.
        error: Relative error of the accelerations.
        floor: What rounding the state to doubles moves the exact answer by.
        note: What the method said, else empty.
    """

    case: str
    distance: float
    method: str
    setting: str
    error: float
    floor: float
    note: str


class Job(NamedTuple):
    """A command of the command line, from start to end.

    Attributes:
        command: What was run.
        rows: Rows of the table.
        cores: Cores it may use.
        seconds: Wall time.
        mib: Peak memory [MiB].
    """

    command: str
    rows: int
    cores: int
    seconds: float
    mib: float


class Count(NamedTuple):
    """Instructions counted by callgrind.

    Attributes:
        case: Robot.
        model: "ddm" or "idm".
        method: Method.
        setting: Setting, in words.
        batch: Samples per call.
        instructions: Per sample; NaN where not measured.
        own: Those of them in the library that was compiled for the robot.
        note: Why it was not measured.
    """

    case: str
    model: str
    method: str
    setting: str
    batch: int
    instructions: float
    own: float
    note: str


class Limit(NamedTuple):
    """How near a compiled model comes to what one core can do.

    Attributes:
        case: Robot.
        model: "ddm" or "idm".
        operations: Of a sample, a fused multiply-add counted as two.
        us: Least time per sample in a batch on one thread [us].
        peak: Most operations of one core per second [1e9 / s].
        share: Operations over time, over the peak.
        cores: The peak of all cores at once, over that of one times their number.
    """

    case: str
    model: str
    operations: int
    us: float
    peak: float
    share: float
    cores: float


class Waited(NamedTuple):
    """What a user's program waits for.

    Attributes:
        case: Robot.
        program: What is run.
        what: The part that is measured.
        value: Its time, or a ratio.
        unit: Unit of the value, empty for a ratio of like things.
    """

    case: str
    program: str
    what: str
    value: float
    unit: str


#: The sections and the rows of each, in the order in which they are measured; `Check` rows open each.
SECTIONS: dict[str, type[Any]] = {
    "ddm": Point,
    "idm": Point,
    "scaling": Size,
    "simulation": Flight,
    "controlled": Controlled,
    "throughput": Point,
    "derivatives": Point,
    "singular": Near,
    "callgrind": Count,
    "peak": Limit,
    "job": Job,
    "programs": Waited,
}


def write_rows(path: Path, kind: type[Any], rows: Iterable[Sequence[Any]]) -> None:
    """Write rows, numbers with six digits."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(kind._fields)
        writer.writerows([f"{x:.6g}" if isinstance(x, float) else x for x in row] for row in rows)


def read_rows(path: Path, kind: type[Any]) -> list[Any]:
    """Read rows back, none where there is no file."""
    if not path.exists():
        return []
    types = get_type_hints(kind)
    with path.open(newline="", encoding="utf-8") as file:
        return [kind(*(types[name](row[name]) for name in kind._fields)) for row in csv.DictReader(file)]


def machine() -> dict[str, str]:
    """Describe the machine and the versions."""
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
    return facts


def write_machines(path: Path, machines: dict[str, dict[str, str]]) -> None:
    """Write the description of the machine of each section."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("section", "fact", "value"))
        writer.writerows((section, *fact) for section, facts in machines.items() for fact in facts.items())


def read_machines(path: Path) -> dict[str, dict[str, str]]:
    """Read them back."""
    out: dict[str, dict[str, str]] = {}
    if path.exists():
        with path.open(newline="", encoding="utf-8") as file:
            for row in csv.DictReader(file):
                out.setdefault(row["section"], {})[row["fact"]] = row["value"]
    return out


def _processor() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or "unknown"


def _first_line(words: list[str]) -> str:
    try:
        done = subprocess.run(words, capture_output=True, text=True, cwd=Path(__file__).parent)
    except OSError:
        return "none"
    return (done.stdout.splitlines() or ["unknown"])[0]
