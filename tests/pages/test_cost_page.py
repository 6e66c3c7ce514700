"""The page on what accuracy costs: its commands run and write the files that they name."""

from __future__ import annotations

import csv
import re
import shlex
import tomllib
from pathlib import Path

import pytest

from hybridyn.cli import main
from hybridyn.cli.cost import COLUMNS
from hybridyn.studies.cost import settings
from tests import ROOT
from tests.snippets import blocks, stand_where_a_user_does

PAGE = ROOT / "docs" / "cost.md"


@pytest.mark.slow
def test_commands_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    stand_where_a_user_does(tmp_path, monkeypatch)
    monkeypatch.setattr(settings, "FACTORS", (4.0,))
    monkeypatch.setattr(settings, "TOLERANCES", (1e-7,))
    text = "".join(block.text for block in blocks(PAGE, "console"))
    lines = re.findall(r"^\$ hybridyn (.*)$", text, re.MULTILINE)
    assert len(lines) == 3
    out = ""
    for line in lines:
        assert main(shlex.split(line)) == 0, line
        out = capsys.readouterr().out
    assert out.startswith("# ")
    assert tomllib.loads(out)["solver"]["method"]
    assert Path("cost.png").stat().st_size > 1000
    with Path("cost.csv").open() as file:
        assert next(csv.reader(file)) == list(COLUMNS)


def test_the_page_names_every_column_and_family() -> None:
    page = PAGE.read_text()
    for column in COLUMNS:
        assert f"`{column}`" in page
    assert (ROOT / "docs" / "pictures" / "cost.png").stat().st_size < 150_000
