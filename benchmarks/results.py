"""Results as rows of a CSV file, and the machine that they belong to."""

from __future__ import annotations

import csv
import os
import platform
import subprocess
from collections.abc import Iterable
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import NamedTuple

PACKAGES = ("hybridyn", "pin", "numpy")


class Result(NamedTuple):
    """One measured number.

    Attributes:
        case: What was run.
        parameter: What was varied ("modules", "rows", "cores").
        at: Its value.
        quantity: What was measured.
        value: The number.
        unit: Its unit.
    """

    case: str
    parameter: str
    at: int
    quantity: str
    value: float
    unit: str


def write_results(path: Path, results: Iterable[Result]) -> None:
    """Write results with six digits."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(Result._fields)
        writer.writerows([*r[:4], f"{r.value:.6g}", r.unit] for r in results)


def read_results(path: Path) -> list[Result]:
    """Read them back."""
    with path.open(newline="", encoding="utf-8") as file:
        rows = csv.DictReader(file)
        return [
            Result(r["case"], r["parameter"], int(r["at"]), r["quantity"], float(r["value"]), r["unit"])
            for r in rows
        ]


def machine() -> dict[str, str]:
    """Describe the machine and the versions."""
    facts = {
        "processor": _processor(),
        "cores": str(os.cpu_count()),
        "system": f"{platform.system()} {platform.machine()}",
        "Python": platform.python_version(),
    }
    for package in PACKAGES:
        try:
            facts[package] = version(package)
        except PackageNotFoundError:
            facts[package] = "from this folder"
    facts["commit"] = _commit()
    return facts


def write_machine(path: Path, facts: dict[str, str]) -> None:
    """Write the description of the machine."""
    with path.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows([("fact", "value"), *facts.items()])


def read_machine(path: Path) -> dict[str, str]:
    """Read it back."""
    with path.open(newline="", encoding="utf-8") as file:
        return {row["fact"]: row["value"] for row in csv.DictReader(file)}


def _processor() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or "unknown"


def _commit() -> str:
    words = ["git", "describe", "--always", "--dirty"]
    try:
        done = subprocess.run(words, capture_output=True, text=True, cwd=Path(__file__).parent)
    except OSError:
        return "unknown"
    return done.stdout.strip() or "unknown"
