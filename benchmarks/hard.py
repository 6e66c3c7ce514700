"""The hard cases as one command, and the table of what each claims and measures.

    python -m benchmarks --hard

runs `pytest tests/hard`, the slow tests too, and writes `results/hard.csv` and `hard.md`: for each case and
quantity the bound that the test claims, the worst number measured, and what is left between the two.
"""

from __future__ import annotations

import csv
import json
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from benchmarks.cases import ROOT

COLUMNS = ("case", "quantity", "claim", "measured", "margin", "test")
HEAD = """# Hard cases: claimed and measured

Written by `python -m benchmarks --hard` from the tests in `tests/hard/`; where a number is claimed for many
samples, the worst stands here. The margin is the claim over what was measured ("exact" where that is zero).
What happens in each case and why: [hard cases](../docs/hard-cases.md). Each test says where its bound comes
from.
"""


class Row(NamedTuple):
    """One line of the table: a claim with the worst number measured for it."""

    case: str
    quantity: str
    claim: float
    measured: float
    test: str

    @property
    def holds(self) -> bool:
        """Whether the claim holds."""
        return self.measured <= self.claim

    @property
    def margin(self) -> str:
        """How far the number stays under its claim, in words."""
        if not self.holds:
            return "FAILS"
        return "exact" if self.measured <= 0 else f"{self.claim / self.measured:.2g}"


def run_hard(folder: Path, jobs: int = 3) -> int:
    """Run the hard cases in some processes, write their table and page; gives pytest's exit status.

    Args:
        folder: Where `results/hard.csv` and `hard.md` go.
        jobs: Number of processes.
    """
    with tempfile.TemporaryDirectory() as scratch:
        claims = Path(scratch) / "claims.jsonl"
        claims.touch()
        options = ["-q", "-m", "slow or not slow", "-n", str(jobs), "tests/hard"]
        status = subprocess.run(
            [sys.executable, "-m", "pytest", *options],
            cwd=ROOT,
            env=os.environ | {"HYBRIDYN_CLAIMS": str(claims)},
            check=False,
        ).returncode
        rows = table(claims.read_text().splitlines())
    (folder / "results").mkdir(parents=True, exist_ok=True)
    with (folder / "results" / "hard.csv").open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerows([COLUMNS, *map(cells, rows)])
    (folder / "hard.md").write_text(page(rows, status))
    return status


def table(lines: Iterable[str]) -> list[Row]:
    """Return one row per test, case, quantity and claim, the worst number of each, in that order.

    Args:
        lines: What the `claim` fixture wrote, one JSON object per line, in any order.
    """
    worst: dict[tuple[str, str, str, float], float] = {}
    for line in lines:
        claim = json.loads(line)
        test = claim["test"].partition("[")[0]
        key = (test, claim["case"], claim["quantity"], float(claim["bound"]))
        measured = float(claim["measured"])
        before = worst.get(key, -math.inf)
        worst[key] = measured if math.isnan(measured) or measured > before else before
    return [
        Row(case, quantity, bound, measured, test)
        for (test, case, quantity, bound), measured in sorted(worst.items())
    ]


def cells(row: Row) -> tuple[str, str, str, str, str, str]:
    """Return a row's cells; two digits are all that other machines' rounding leaves alike."""
    return (row.case, row.quantity, f"{row.claim:.3g}", f"{row.measured:.2g}", row.margin, row.test)


def page(rows: list[Row], status: int) -> str:
    """Return the table as Markdown, by file of tests; what fails stands first.

    Args:
        rows: The rows, by test.
        status: Pytest's exit status.
    """
    broken = [row for row in rows if not row.holds]
    lines = [HEAD, f"{len(rows)} claims, {len(broken)} of them broken; pytest's exit status {status}.", ""]
    if broken:
        lines += ["## Broken claims", "", *_lines(broken), ""]
    files: dict[str, list[Row]] = {}
    for row in rows:
        files.setdefault(row.test.partition("::")[0], []).append(row)
    for file, members in files.items():
        lines += [f"## {Path(file).stem.removeprefix('test_').replace('_', ' ').capitalize()}", ""]
        lines += [f"[`{file}`](../{file})", "", *_lines(members), ""]
    return "\n".join(lines)


def _lines(rows: list[Row]) -> list[str]:
    """Return the lines of a Markdown table, without its column of files."""
    out = ["| case | quantity | claim | measured | margin | test |", "|---|---|--:|--:|--:|---|"]
    for row in rows:
        case, quantity, claim, measured, margin, test = (cell.replace("|", "\\|") for cell in cells(row))
        name = test.rpartition("::")[2].removeprefix("test_").replace("_", " ")
        out.append(f"| {case} | {quantity} | {claim} | {measured} | {margin} | {name} |")
    return out
