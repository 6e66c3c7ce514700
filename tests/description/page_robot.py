"""The five-bar that the page of a format shows: what the page says is what hybridyn reads."""

from __future__ import annotations

from pathlib import Path

import pytest

import hybridyn
from tests import ROOT
from tests.command_line import call
from tests.snippets import blocks


def same_as_its_page(page: str, language: str, file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Write the five-bar of a page, read it, and compare with what the page shows.

    Args:
        page: Name of the page.
        language: Language of the block that holds the robot.
        file: The file to be written, in the folder where the test runs.
        capsys: Takes the output of the commands.
    """
    (example,) = blocks(ROOT / "docs" / page, language)
    file.write_text(example.text)
    robot = hybridyn.load(file)
    assert robot.motors == ("motor_left", "motor_right")
    assert robot.mobility == 2
    assert [joint.effort for joint in robot.description.joints if joint.name in robot.motors] == [50, 50]
    assert hybridyn.closure_residual(robot, robot.home) < 1e-12
    assert robot.description.notes == ()
    shown = (ROOT / "docs" / page).read_text()
    for line in call(capsys, "info", file.name).out.splitlines()[:4]:
        assert line in shown
    assert "error" not in call(capsys, "check", file.name).out
