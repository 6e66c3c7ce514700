"""The table of the hard cases: worst of each, sorted, and a broken claim said plainly."""

import json
from itertools import permutations
from pathlib import Path

import pytest

from benchmarks.hard import margin, page, run_hard, table


def line(test: str, case: str, quantity: str, measured: float, bound: float) -> dict[str, str | float]:
    """Return a line as the fixture writes it."""
    path = f"tests/hard/{test}"
    return {"test": path, "case": case, "quantity": quantity, "measured": measured, "bound": bound}


LINES = [
    line("test_b.py::test_two[1]", "robot", "error", 1e-15, 1e-13),
    line("test_b.py::test_two[2]", "robot", "error", 3e-15, 1e-13),
    line("test_a.py::test_one", "a | b", "count", 0, 0),
]
BROKEN = line("test_a.py::test_one", "bad", "x", 2.0, 1.0)


def test_the_worst_of_each_claim_stands_in_any_order() -> None:
    """Processes write in any order: the table is the same."""
    tables = [table(json.dumps(x) for x in order) for order in permutations(LINES)]
    assert all(t == tables[0] for t in tables)
    assert [row["test"] for row in tables[0]] == [
        "tests/hard/test_a.py::test_one",
        "tests/hard/test_b.py::test_two",
    ]
    found = ("robot", "error", "1e-13", "3e-15", "33", "tests/hard/test_b.py::test_two")
    assert tuple(tables[0][1].values()) == found
    assert tables[0][0]["margin"] == "exact"


@pytest.mark.parametrize("measured", [2.0, float("nan"), float("inf")])
def test_a_broken_claim_is_shown_plainly(measured: float) -> None:
    rows = table(json.dumps(x) for x in [*LINES, {**BROKEN, "measured": measured}, BROKEN])
    broken = next(row for row in rows if row["case"] == "bad")
    assert broken["margin"] == "FAILS"
    text = page(rows)
    assert "3 claims, 1 of them broken" in text
    assert text.index("## Broken claims") < text.index("|bad|") < text.index("|[a](../tests/hard/test_a.py)|")
    assert "|FAILS|bad: x|" in text


def test_the_page_escapes_bars_and_names_files() -> None:
    more = line("test_a.py::test_one", "a | b", "error", 1e-15, 1e-12)
    text = page(table(json.dumps(x) for x in [*LINES, more]))
    assert "|2|1e+03|a \\| b: error|" in text
    assert "|[b](../tests/hard/test_b.py)|" in text
    assert "Broken" not in text


def test_a_file_whose_numbers_are_all_zero_is_exact() -> None:
    assert "|1|exact||" in page(table([json.dumps(LINES[-1])]))


def test_tests_are_run_and_what_they_claim_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The command is pytest's with the file to write to; its status is given back."""
    import subprocess

    def run(command: list[str], env: dict[str, str], **_: object) -> subprocess.CompletedProcess[str]:
        assert command[-1] == "tests/hard"
        Path(env["HYBRIDYN_CLAIMS"]).write_text("".join(json.dumps(line) + "\n" for line in LINES))
        return subprocess.CompletedProcess(command, 1)

    monkeypatch.setattr("benchmarks.hard.subprocess.run", run)
    assert run_hard(tmp_path) == 1
    csv = (tmp_path / "results/hard.csv").read_text().splitlines()
    assert csv[0] == "case,quantity,claim,measured,margin,test"
    assert len(csv) == 3
    assert "2 claims, 0 of them broken" in (tmp_path / "hard.md").read_text()
    assert margin(1.0, 0.5) == "2"
