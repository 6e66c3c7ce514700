"""What a sweep costs: a design, a posture, an engine, and what 1,000 cores would do in a day.

    python -m benchmarks.sweeps [--designs 24]

runs sweeps of the five-bar in programs of their own, and writes `results/sweeps.csv` and `sweeps.md`.
Times are processor times with all child processes, in which a busy machine shows little; wall times are
given beside them.
"""

from __future__ import annotations

import argparse
import csv
import os
import subprocess
import sys
import tempfile
import time
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.cases import ROOT

TARGET = ROOT / "benchmarks" / "results" / "sweeps.csv"
PAGE = ROOT / "benchmarks" / "sweeps.md"
HEAD = """# What a sweep costs

Written by `python -m benchmarks.sweeps` from sweeps of the five-bar by the general path (`--engine general`).
Times are processor times of all child processes; Ray's processes are not among them. With one process, loky
computes in the program itself.
"""
#: Engines, the package that each needs, and its numbers of processes; one process of loky is the program.
ENGINES = (("loky", "joblib", (1, 2)), ("dask", "distributed", (1, 2)), ("ray", "ray", (1, 2)))
#: Postures of a design; a table with fewer rows takes longer, because steps between its rows are divided.
POSTURES = (81, 4001)
CORES, DAY = 1000, 86400.0
STUDY = """[robot]
file = "five_bar"
[designs]
method = "sobol"
count = {designs}
seed = 1
[parameters]
upper_length = {{ range = [0.22, 0.30] }}
lower_length = {{ range = [0.38, 0.45] }}
[tasks.pick]
trajectory = "pick.csv"
measure = ["peak_effort"]
"""


class Run(NamedTuple):
    """One sweep.

    Attributes:
        engine: The engine.
        workers: Number of processes.
        designs: Number of designs.
        postures: Postures of each design.
        processor: Processor time of all processes [s].
        wall: Wall time [s].
    """

    engine: str
    workers: int
    designs: int
    postures: int
    processor: float
    wall: float


def run(engine: str, workers: int, designs: int, postures: int) -> Run:
    """Run a sweep in a program of its own."""
    with tempfile.TemporaryDirectory() as place:
        Path(place, "study.toml").write_text(STUDY.format(designs=designs))
        t = np.linspace(0.0, 0.8, postures)
        tau = 1 - np.abs(t / 0.4 - 1)
        s = tau**3 * (10 - 15 * tau + 6 * tau**2)
        rows = np.column_stack([t, -0.15 + 0.3 * s, -0.48 + 0.96 * (s * (1 - s)) ** 2])
        header = "time,m1_tool/pose/x,m1_tool/pose/z"
        np.savetxt(Path(place, "pick.csv"), rows, "%.6f", ",", header=header, comments="")
        words = [
            "sweep",
            "--engine",
            "general",
            "study.toml",
            "-o",
            "out",
            "--pool",
            engine,
            "--jobs",
            str(workers),
            "--format",
            "csv",
        ]
        started = time.perf_counter()
        with open(os.devnull, "w") as nothing:
            program = subprocess.Popen(
                [sys.executable, "-m", "hybridyn", *words], cwd=place, stdout=nothing, stderr=nothing
            )
            _, status, used = os.wait4(program.pid, 0)
        program.returncode = os.waitstatus_to_exitcode(status)
        wall = time.perf_counter() - started
    if status:
        raise RuntimeError(f"a sweep on {engine} failed")
    return Run(engine, workers, designs, postures, used.ru_utime + used.ru_stime, wall)


def planned(designs: int) -> list[tuple[str, int, int, int]]:
    """Return the sweeps to run: few and many designs and postures in one process, then the engines."""
    runs = [("loky", 1, few, postures) for few in (2, designs) for postures in POSTURES]
    for engine, package, workers in ENGINES:
        if find_spec(package):
            runs += [(engine, n, designs, POSTURES[0]) for n in workers if (engine, n) != ("loky", 1)]
    return runs


class Cost(NamedTuple):
    """Costs of processor time.

    Attributes:
        start: The program [s].
        design: A design without postures [ms].
        posture: A posture [ms].
    """

    start: float
    design: float
    posture: float


def cost(runs: list[Run]) -> Cost:
    """Compute the costs by least squares from the runs in one process."""
    alone = [one for one in runs if (one.engine, one.workers) == ("loky", 1)]
    rows = [[1.0, one.designs, one.designs * one.postures] for one in alone]
    start, design, posture = np.linalg.lstsq(rows, [one.processor for one in alone], rcond=None)[0].tolist()
    return Cost(start, 1e3 * design, 1e3 * posture)


def page(runs: list[Run]) -> str:
    """Return the page of the costs."""
    return f"{HEAD}\n{table(runs)}\n"


def table(runs: list[Run]) -> str:
    """Return the costs of a design, and those of the engines."""
    found = cost(runs)
    most = [one for one in runs if one.designs == max(one.designs for one in runs)]
    most = [one for one in most if one.postures == POSTURES[0]]
    each = found.design + POSTURES[0] * found.posture
    lines = [
        "| | |",
        "|---|---|",
        f"| start of a sweep | {found.start:.1f} s |",
        f"| a design, without postures | {found.design:.0f} ms |",
        f"| a posture | {found.posture:.2f} ms |",
        f"| a design with {POSTURES[0]} postures | {each:.0f} ms |",
        f"| such designs on {CORES:,} cores in a day | {CORES * DAY / each * 1e3 / 1e6:.0f} million |",
        "",
        "| engine | processes | processor time | wall time |",
        "|---|---|---|---|",
    ]
    lines += [f"| {one.engine} | {one.workers} | {one.processor:.1f} s | {one.wall:.1f} s |" for one in most]
    return "\n".join(lines)


def keep(runs: list[Run]) -> None:
    """Keep the runs."""
    with TARGET.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(Run._fields)
        writer.writerows([*one[:4], f"{one.processor:.2f}", f"{one.wall:.2f}"] for one in runs)


def read() -> list[Run]:
    """Read the runs that are kept."""
    with TARGET.open(newline="") as file:
        return [
            Run(row["engine"], int(row["workers"]), int(row["designs"]), int(row["postures"]),
                float(row["processor"]), float(row["wall"]))
            for row in csv.DictReader(file)
        ]  # fmt: skip


def main() -> None:
    """Measure, keep the runs, and write the page."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--designs", type=int, default=24, help="designs of a long sweep")
    keep([run(*one) for one in planned(parser.parse_args().designs)])
    PAGE.write_text(page(read()))


if __name__ == "__main__":
    main()
