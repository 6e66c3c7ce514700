"""The page on written-out models: its commands run (its Python runs with the other pages')."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from hybridyn.cli import main
from tests import ROOT
from tests.snippets import blocks, stand_where_a_user_does


@pytest.mark.slow
def test_commands_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    stand_where_a_user_does(tmp_path, monkeypatch)
    text = "".join(block.text for block in blocks(ROOT / "docs" / "compiled.md", "console"))
    lines = re.findall(r"^\$ hybridyn (.*)$", text, re.MULTILINE)
    assert len(lines) == 1
    for line in lines:
        assert main(shlex.split(line)) == 0
    assert capsys.readouterr().out == ""
    kinds = {path.suffix or path.name for path in (tmp_path / "five_bar_c").iterdir()}
    assert {".h", ".c", "Makefile", ".md"} <= kinds
