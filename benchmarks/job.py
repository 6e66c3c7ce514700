"""The main job of the command line, from the start of the program to its end."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.cases import LX4, write_long_trajectory
from benchmarks.processes import only_cores
from benchmarks.results import Job

#: The command line, and then the most memory it ever held [KiB] on standard output.
COMMAND = """
import re, sys
from pathlib import Path
from hybridyn.cli import main
status = main(sys.argv[1:])
proc = Path("/proc/self/status")
peak = re.search(r"VmHWM:\\s*(\\d+)", proc.read_text()) if proc.exists() else None
print(peak[1] if peak else "nan")
sys.exit(status)
"""


def measure(rows: int, cores: int) -> list[Job]:
    """Measure `hybridyn idm` on the LX4, platform poses to efforts.

    Args:
        rows: Rows of the table.
        cores: Number of cores that the program may use.

    Raises:
        RuntimeError: The command failed.
    """
    with tempfile.TemporaryDirectory() as folder, only_cores(cores) as given:
        table = Path(folder) / "trajectory.csv"
        write_long_trajectory(table, rows)
        words = ["idm", str(LX4), str(table), "-o", str(Path(folder) / "efforts.csv"), "-q"]
        started = time.perf_counter()
        done = subprocess.run([sys.executable, "-c", COMMAND, *words], capture_output=True, text=True)
        wall = time.perf_counter() - started
    if done.returncode:
        raise RuntimeError(f"hybridyn idm failed: {done.stderr.strip()}")
    return [Job("idm", rows, cores, wall if given else float("nan"), float(done.stdout) / 1024.0)]
