"""The page on viewing and plotting: its commands run and write the files that they name."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from hybridyn.cli import COMMANDS, main
from tests import ROOT
from tests.extras import needs
from tests.snippets import blocks, stand_where_a_user_does

PAGE = ROOT / "docs" / "view-and-plot.md"
FILE = re.compile(r"[\w.]+\.(png|svg|pdf|html|mp4|csv)")


@pytest.mark.slow
def test_commands_write_the_files_that_they_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    needs("view")
    stand_where_a_user_does(tmp_path, monkeypatch)
    text = "".join(block.text for block in blocks(PAGE, "console"))
    lines = [line.removeprefix("$ ") for line in text.splitlines() if line.startswith("$ ")]
    assert len(lines) == 6
    for line in lines:
        program, *words = shlex.split(line)
        assert program == "hybridyn"
        assert main(words) == 0, line
        for word in words:
            if FILE.fullmatch(word):
                assert Path(word).stat().st_size > 1000, (line, word)
    capsys.readouterr()


def test_commands_that_are_only_shown_exist() -> None:
    shown = [block.text for block in blocks(PAGE, "sh") if block.text.startswith("hybridyn")]
    assert [text.split()[1] for text in shown] == ["view"]
    assert "view" in COMMANDS


@pytest.mark.parametrize("name", ["view.jpg", "lx4.png", "efforts.svg", "structure.svg"])
def test_pictures_of_the_page_are_small(name: str) -> None:
    assert f"(pictures/{name})" in PAGE.read_text()
    assert (ROOT / "docs" / "pictures" / name).stat().st_size < 150_000
