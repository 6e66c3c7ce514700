"""docs/sweeps.md: its study runs and prints what is shown, and it names every key and measure."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest

from benchmarks.sweeps import read, table
from hybridyn.cli import main
from hybridyn.studies.sweep.evaluation import STATUSES
from hybridyn.studies.sweep.measures import OF_MOTORS, OF_WORKSPACE, STATISTICS
from hybridyn.studies.sweep.reading import FIXED_COLUMNS, read_study
from hybridyn.studies.sweep.study_tables import DesignsTable, ParameterTable, TaskTable, WorkspaceTable
from tests import ROOT
from tests.extras import needs
from tests.pages.test_readme import same_line
from tests.snippets import blocks, run_python, stand_where_a_user_does

PAGE = ROOT / "docs" / "sweeps.md"


def write_files() -> None:
    for block in blocks(PAGE, "toml"):
        Path(block.facts.get("file", "study.toml")).write_text(block.text)


@pytest.mark.slow
def test_commands_print_what_is_shown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    needs("sweep")
    stand_where_a_user_does(tmp_path, monkeypatch)
    run_python(PAGE)
    write_files()
    for block in blocks(PAGE, "console"):
        command, _, expected = block.text.removeprefix("$ ").partition("\n")
        assert main(shlex.split(command)[1:]) == 0
        out, err = capsys.readouterr()
        for found, wanted in zip((out + err).splitlines(), expected.splitlines(), strict=True):
            assert same_line(found, wanted) or "busy" in wanted, (found, wanted)


def test_the_study_of_the_page_is_right(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    run_python(PAGE)
    write_files()
    assert len(read_study("study.toml").columns) == 4
    assert read_study("falls.toml").columns == ["landing", "speed", "braking"]


def test_the_costs_are_those_that_were_measured() -> None:
    assert table(read()) in PAGE.read_text()


def test_every_key_and_measure_is_named() -> None:
    text = PAGE.read_text()
    keys = {
        key
        for table in (DesignsTable, ParameterTable, TaskTable, WorkspaceTable)
        for key in table.model_fields
    }
    words = {*keys, *OF_MOTORS, *OF_WORKSPACE, *STATISTICS, *STATUSES, *FIXED_COLUMNS}
    assert [
        word for word in sorted(words) if not any(f"{mark}{word}" in text for mark in ("`", "designs."))
    ] == []
