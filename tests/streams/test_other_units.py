"""A table in degrees or millimetres, and a closure's frame in millimetres, are asked for their unit."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hybridyn import AssemblyError
from hybridyn.structure.building import build_robot
from tests.command_line import call, table_text
from tests.comparing import refused
from tests.shipped import shipped

TIME = np.linspace(0.0, 1.0, 21)
ARMS = ["time", "m1_left_drive/position", "m1_right_drive/position"]
TOOL = ["time", "m1_tool/pose/x", "m1_tool/pose/z"]
SWING = np.column_stack([-0.2 + 0.5 * np.sin(TIME), 0.2 + 0.3 * np.sin(TIME)])  # rad
PLACE = np.column_stack([0.1 * TIME, np.full(21, -0.45)])  # m


@pytest.mark.parametrize(
    ("header", "values", "status", "words"),
    [
        (
            ARMS,
            SWING * 180 / np.pi,
            0,
            "limit 1.2 rad, by 24.7 rad; first at row 1 (0 s), 21 samples: degrees?",
        ),
        (ARMS, SWING, 0, ""),
        (TOOL, PLACE * 1000, 1, "'m1_tool' goes to 450 m, and the robot's size is 0.25 m: millimetres?"),
        (TOOL, PLACE - 1.0, 1, ""),
    ],
)
def test_tables(
    header: list[str], values: np.ndarray, status: int, words: str, tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    (tmp_path / "motion.csv").write_text(table_text(header, np.column_stack([TIME, values])))
    said = call(capsys, "idm", "five_bar", tmp_path / "motion.csv", "-o", tmp_path / "out.csv", status=status)
    asked = [line for line in said.err.splitlines() if line.endswith("?")]
    assert bool(asked) == bool(words)
    assert words in said.err


@pytest.mark.slow
def test_a_slide_in_millimetres(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    names = [f"m1_leg{i}_slide/position" for i in range(1, 7)]
    rows = np.column_stack([TIME, *[50.0 + TIME] * 6])
    (tmp_path / "motion.csv").write_text(table_text(["time", *names], rows))
    said = call(capsys, "idm", "gough_stewart", tmp_path / "motion.csv", status=1)
    assert said.err.endswith("'m1_leg1_slide' goes to 51 m (limits -0.2 and 0.2): millimetres?\n")


def test_a_frame_of_a_closure() -> None:
    d = shipped("five_bar")
    frame = d.closures[0].frame_b.copy()
    frame[:3, 3] *= 1000
    far = replace(d, closures=(replace(d.closures[0], frame_b=frame),))
    words = "The frame of 'm1_tip' on 'm1_right_lower' is 400 m from its link, and no .*: millimetres\\?$"
    refused(lambda: build_robot(far), AssemblyError, words)
