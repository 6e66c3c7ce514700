"""The hard cases as one command, and the table of what each claims and measures.

    python -m benchmarks --hard

runs `pytest tests/hard`, the slow tests too, and writes `results/hard.csv`: for each case and quantity the
bound that the test claims, the worst number measured, and what is left between the two. `hard.md` has a line
for each file of tests.
"""

from __future__ import annotations

import ast
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
from benchmarks.fronts import grouped
from benchmarks.results import read_table, write_table
from benchmarks.tables import table as markdown

COLUMNS = ("case", "quantity", "claim", "measured", "margin", "test")
HEAD = """# Hard cases: claimed and measured

`python -m benchmarks --hard` writes this page from the tests in `tests/hard/`. The margin is the claim over
the worst number that was measured; a number of zero has none. [All claims](results/hard.csv) stand in a
table, with the bound, the worst number and the test of each. What happens in each case and why:
[hard cases](../docs/hard-cases.md). Each test says where its bound comes from.
"""


class Row(NamedTuple):
    """A claim with the worst number measured for it."""

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

    @property
    def file(self) -> str:
        """The file of the test."""
        return self.test.partition("::")[0]


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
    write_table(folder / "results" / "hard.csv", COLUMNS, map(cells, rows))
    write_page(folder)
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


def read_claims(folder: Path) -> list[Row]:
    """Read the claims that are kept in a folder."""
    found = read_table(folder / "hard.csv")
    return [Row(x["case"], x["quantity"], float(x["claim"]), float(x["measured"]), x["test"]) for x in found]


def write_page(folder: Path) -> None:
    """Write the page of the claims that are kept in a folder."""
    (folder / "hard.md").write_text(page(read_claims(folder / "results")))


def page(rows: list[Row]) -> str:
    """Return the page as Markdown: a line for each file of tests; what fails stands first."""
    broken = [row for row in rows if not row.holds]
    lines = [HEAD, f"{len(rows):,} claims, {len(broken)} of them broken.\n"]
    if broken:
        lines += ["## Broken claims\n", markdown(COLUMNS, [cells(row) for row in broken])]
    head = ["file", "what it claims", "claims", "least margin", "of"]
    lines.append(markdown(head, [_line(file, own) for file, own in grouped(rows, "file").items()]))
    return "\n".join(lines)


def _line(file: str, rows: list[Row]) -> list[str]:
    """Return the line of a file of tests."""
    source = ROOT / file
    said = ast.get_docstring(ast.parse(source.read_text())) if source.exists() else None
    name = Path(file).stem.removeprefix("test_").replace("_", " ")
    link, what = f"[{name}](../{file})", (said or "").partition("\n")[0]
    measured = [row for row in rows if not row.measured <= 0]
    if not measured:
        return [link, what, str(len(rows)), "exact", ""]
    least = min(measured, key=lambda row: row.claim / row.measured if row.holds else -1.0)
    return [link, what, str(len(rows)), least.margin, f"{least.case}: {least.quantity}"]
