"""The slow tests as one command, and the table of what they came to.

    python -m benchmarks --slow

runs `pytest -m slow` and writes `results/slow.csv`: for each test its cases, how many failed, and seconds.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path
from xml.etree import ElementTree

from benchmarks.cases import ROOT
from benchmarks.results import write_table

COLUMNS = ("file", "test", "cases", "failed", "seconds")


def run_slow(target: Path, jobs: int = 3) -> int:
    """Run the slow tests in some processes, write their table; gives pytest's exit status."""
    with tempfile.TemporaryDirectory() as folder:
        record = Path(folder) / "slow.xml"
        options = ["-q", "-m", "slow", "-n", str(jobs), f"--junitxml={record}"]
        status = subprocess.run([sys.executable, "-m", "pytest", *options], cwd=ROOT, check=False).returncode
        rows = table(record.read_text())
    write_table(target, COLUMNS, rows)
    return status


def table(junit: str) -> list[tuple[str, str, int, int, str]]:
    """Sum up pytest's JUnit record by test function, in order of file and name."""
    sums: dict[tuple[str, str], list[float]] = {}
    for case in ElementTree.fromstring(junit).iter("testcase"):  # written by pytest just now
        file = case.attrib["classname"].replace(".", "/") + ".py"
        total = sums.setdefault((file, case.attrib["name"].partition("[")[0]), [0, 0, 0.0])
        total[0] += 1
        total[1] += any(child.tag in ("failure", "error") for child in case)
        total[2] += float(case.attrib["time"])
    return [
        (*key, int(cases), int(failed), f"{seconds:.1f}")
        for key, (cases, failed, seconds) in sorted(sums.items())
    ]
