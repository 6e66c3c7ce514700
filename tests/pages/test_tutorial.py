"""The tutorial: every block of it, one after the other, in an empty folder."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.cli import main
from tests import ROOT
from tests.pages.test_readme import same_line
from tests.snippets import blocks

PAGE = ROOT / "docs" / "tutorial.md"


def run_commands(text: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Run the commands of a block; where output is shown it is compared."""
    for part in re.split(r"^\$ ", text, flags=re.MULTILINE)[1:]:
        command, _, expected = part.partition("\n")
        program, *words = shlex.split(command)
        assert (program, main(words)) == ("hybridyn", 0), command
        told = capsys.readouterr()
        if expected:
            for found, wanted in zip((told.out + told.err).splitlines(), expected.splitlines(), strict=True):
                assert same_line(found, wanted), (command, found, wanted)


def test_the_tutorial_runs_from_its_first_to_its_last_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "90")
    names: dict[str, object] = {"__name__": "__page__"}
    robot = Path("five.urdf")
    for block in blocks(PAGE):
        if "file" in block.facts:
            assert block.facts["file"] == robot.name
            robot.write_text(block.text)
        elif "before" in block.facts:
            head, found, tail = robot.read_text().partition(block.facts["before"])
            assert found
            robot.write_text(head + block.text + found + tail)
        elif block.language == "console":
            run_commands(block.text, capsys)
        elif block.language == "python":
            exec(compile("\n" * (block.line - 1) + block.text, str(PAGE), "exec"), names)
    assert {path.name for path in tmp_path.glob("*.csv")} == {
        "wave.csv", "torques.csv", "with_friction.csv", "motors.csv"
    }  # fmt: skip
    assert Path("torques.png").stat().st_size > 1000
    five = names["robot"]
    assert isinstance(five, hybridyn.HybridRobot)
    assert five.motors == ("left_drive", "right_drive")
    swing = names["swing"]
    assert np.ptp(swing.energy) < 1e-4 * swing.kinetic.max()  # type: ignore[attr-defined]  # rtol 1e-6, some 50 steps
