"""The robot of the page of SDF is read as the page says, and written as it says."""

from __future__ import annotations

from pathlib import Path

import pytest

import hybridyn
from tests import ROOT
from tests.command_line import call
from tests.snippets import blocks

PAGE = ROOT / "docs" / "sdf.md"


def test_the_robot_of_the_page(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (example,) = blocks(PAGE, "xml")
    (tmp_path / "four_bar.sdf").write_text(example.text)
    robot = hybridyn.load("four_bar.sdf")
    assert (robot.motors, robot.mobility, robot.description.root) == (("motor",), 1, "frame")
    assert hybridyn.closure_residual(robot, robot.home) < 1e-14
    told, _, _ = call(capsys, "info", "four_bar.sdf").out.partition("\n\n")
    assert " ".join(told.split()) in " ".join(PAGE.read_text().split())  # lines break where the terminal ends
    call(capsys, "convert", "four_bar.sdf", "-o", "other.sdf", "--strict")
    assert [path.name for path in sorted(tmp_path.iterdir())] == [
        "four_bar.sdf",
        "other.sdf",
        "other.sdf.model.toml",
    ]
