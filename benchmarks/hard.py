"""The hard cases and the slow tests, each as one command, and the tables of what they came to.

    python -m benchmarks --hard
    python -m benchmarks --slow

The first runs `pytest tests/hard`, the slow tests too, and writes `results/hard.csv`: for each case and
quantity the bound that the test claims, the worst number measured, and what is left between the two.
`hard.md` has a line for each file of tests. The second runs `pytest -m slow` and writes `results/slow.csv`:
for each test its cases, how many failed, and seconds.
"""

from __future__ import annotations

import ast
import json
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from xml.etree import ElementTree

from benchmarks.cases import ROOT
from benchmarks.results import read_table, write_table
from benchmarks.texts import table as markdown

#: Processes.
JOBS = 3
#: Words for a margin, and the columns of a claim with the worst number measured for it.
BROKEN, EXACT = "FAILS", "exact"
COLUMNS = ("case", "quantity", "claim", "measured", "margin", "test")
HEAD = """# Hard cases: claimed and measured

`python -m benchmarks --hard` writes this page from the tests in `tests/hard/`. The margin is the claim over
the worst number that was measured; a number of zero has none. [All claims](results/hard.csv) stand in a
table, with the bound, the worst number and the test of each. What happens in each case and why:
[hard cases](../docs/hard-cases.md). Each test says where its bound comes from.
"""


def run_hard(folder: Path) -> int:
    """Run the hard cases, write their table and page into a folder; gives pytest's exit status."""
    with tempfile.TemporaryDirectory() as scratch:
        claims = Path(scratch) / "claims.jsonl"
        claims.touch()
        status = _pytest(["-m", "slow or not slow"], ["tests/hard"], HYBRIDYN_CLAIMS=str(claims))
        rows = table(claims.read_text().splitlines())
    write_table(folder / "results" / "hard.csv", COLUMNS, ([*row.values()] for row in rows))
    write_page(folder)
    return status


def run_slow(target: Path) -> int:
    """Run the slow tests, write their table; gives pytest's exit status."""
    with tempfile.TemporaryDirectory() as scratch:
        record = Path(scratch) / "slow.xml"
        status = _pytest(["-m", "slow"], [f"--junitxml={record}"])
        rows = sums(record.read_text())
    write_table(target, ("file", "test", "cases", "failed", "seconds"), rows)
    return status


def _pytest(chosen: list[str], more: list[str], **environment: str) -> int:
    """Run tests in some processes; gives the exit status."""
    command = [sys.executable, "-m", "pytest", "-q", *chosen, "-n", str(JOBS), *more]
    return subprocess.run(command, cwd=ROOT, env=os.environ | environment, check=False).returncode


def sums(junit: str) -> list[tuple[str, str, int, int, str]]:
    """Sum up pytest's JUnit record by test function, in order of file and name."""
    found: dict[tuple[str, str], list[float]] = {}
    for case in ElementTree.fromstring(junit).iter("testcase"):  # written by pytest just now
        file = case.attrib["classname"].replace(".", "/") + ".py"
        total = found.setdefault((file, case.attrib["name"].partition("[")[0]), [0, 0, 0.0])
        total[0] += 1
        total[1] += any(child.tag in ("failure", "error") for child in case)
        total[2] += float(case.attrib["time"])
    return [(*key, int(n), int(bad), f"{seconds:.1f}") for key, (n, bad, seconds) in sorted(found.items())]


def table(lines: Iterable[str]) -> list[dict[str, str]]:
    """Return one row per test, case, quantity and claim, the worst number of each, in that order.

    Two digits are all that other machines' rounding leaves alike.

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
    rows = [
        (case, quantity, f"{bound:.3g}", f"{measured:.2g}", margin(bound, measured), test)
        for (test, case, quantity, bound), measured in sorted(worst.items())
    ]
    return [dict(zip(COLUMNS, row, strict=True)) for row in rows]


def margin(claim: float, measured: float) -> str:
    """Say how far a number stays under its claim."""
    if not measured <= claim:
        return BROKEN
    return EXACT if measured <= 0 else f"{claim / measured:.2g}"


def write_page(folder: Path) -> None:
    """Write the page of the claims that are kept in a folder."""
    (folder / "hard.md").write_text(page(read_table(folder / "results" / "hard.csv")))


def page(rows: Sequence[dict[str, str]]) -> str:
    """Return the page as Markdown: a line for each file of tests; what fails stands first."""
    broken = [[*row.values()] for row in rows if row["margin"] == BROKEN]
    lines = [HEAD, f"{len(rows):,} claims, {len(broken)} of them broken.\n"]
    if broken:
        lines += ["## Broken claims\n", markdown(COLUMNS, broken)]
    files: dict[str, list[dict[str, str]]] = {}
    for row in rows:
        files.setdefault(row["test"].partition("::")[0], []).append(row)
    head = ["file", "what it claims", "claims", "least margin", "of"]
    lines.append(markdown(head, [_line(file, own) for file, own in files.items()]))
    return "\n".join(lines)


def _line(file: str, rows: Sequence[dict[str, str]]) -> list[str]:
    """Return the line of a file of tests."""
    source = ROOT / file
    said = ast.get_docstring(ast.parse(source.read_text())) if source.exists() else None
    name = Path(file).stem.removeprefix("test_").replace("_", " ")
    margins = {EXACT: math.inf, BROKEN: -1.0}
    least = min(rows, key=lambda row: margins[x] if (x := row["margin"]) in margins else float(x))
    of = "" if least["margin"] == EXACT else f"{least['case']}: {least['quantity']}"
    what = (said or "").partition("\n")[0]
    return [f"[{name}](../{file})", what, str(len(rows)), least["margin"], of]
