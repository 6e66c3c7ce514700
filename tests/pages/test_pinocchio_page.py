"""The page on Pinocchio: its Python prints what the page shows."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests import ROOT
from tests.snippets import blocks, run_python, stand_where_a_user_does

PAGE = ROOT / "docs" / "pinocchio.md"


def test_outputs_are_those_of_the_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    stand_where_a_user_does(tmp_path, monkeypatch)
    run_python(PAGE)
    shown = "".join(block.text for block in blocks(PAGE, "output"))
    assert capsys.readouterr().out == shown
