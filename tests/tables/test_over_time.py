"""Peaks and RMS values of every command, on rows that are spaced unevenly, against a closed form."""

from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.effects.choice import choose
from hybridyn.studies.effect_worth import contributions
from hybridyn.studies.sweep.measures import STATISTICS
from hybridyn.tables.over_time import Means
from tests.support.command_line import call, table_text
from tests.support.files import save

MASS = 2.5
SLIDE = f"""<robot name="slide"><link name="ground"/><link name="bob"><inertial><mass value="{MASS}"/>
  <inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="drive" type="prismatic"><parent link="ground"/><child link="bob"/><axis xyz="1 0 0"/>
  <limit lower="-4" upper="4" effort="1000" velocity="1000"/></joint></robot>"""
END = 2.0
#: Rows that crowd at the start, at which the effort is small.
TIME = END * np.linspace(0.0, 1.0, 41) ** 3
#: The force grows as the root of the time: its square is linear, and trapezoids are exact.
FORCE = MASS * np.sqrt(TIME)
RMS = MASS * np.sqrt(END / 2)
BY_ROWS = float(np.sqrt(np.mean(FORCE**2)))
#: Sums of 41 products.
ROUNDING = 1e-13
#: The table prints six digits.
PRINTED = 5e-6


def files(folder: Path, *, timed: bool = True) -> tuple[Path, Path]:
    still = np.zeros(len(TIME))
    names = ["time", "drive/position", "drive/velocity", "drive/acceleration"]
    table = np.column_stack([TIME, still, still, FORCE / MASS])
    text = table_text(names, table) if timed else table_text(names[1:], table[:, 1:])
    return save(folder, SLIDE, "slide.urdf"), save(folder, text, "motion.csv")


def cells(text: str) -> list[str]:
    """Return the cells of the motor's line."""
    (line,) = (line for line in text.splitlines() if line.startswith("  drive "))
    return line.split()[1:]


def test_the_spacing_of_the_rows_does_not_count(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    robot, motion = files(tmp_path)
    assert abs(BY_ROWS / RMS - 1) > 0.2  # so that the two definitions differ
    peak, rms, unit, at, _ = cells(call(capsys, "idm", robot, motion).err)
    assert [float(peak), float(rms)] == pytest.approx([FORCE[-1], RMS], rel=PRINTED)
    assert (unit, float(at)) == ("N", END)
    sized = cells(call(capsys, "idm", "--loads", robot, motion).out)
    assert [float(sized[0]), float(sized[3])] == pytest.approx([FORCE[-1], RMS], rel=10 * PRINTED)
    slide = hybridyn.load(robot)
    still = np.zeros((len(TIME), 1))
    parts = contributions(slide, still, still, FORCE[:, None] / MASS, choose(slide, None), time=TIME)
    (inertia,) = (part for part in parts if part.name == "inertia")
    assert [inertia.rms[0], inertia.peak[0]] == pytest.approx([RMS, FORCE[-1]], rel=ROUNDING)
    assert STATISTICS["rms"](FORCE, TIME) == pytest.approx(RMS, rel=ROUNDING)


def test_rows_without_times_have_plain_means(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    robot, motion = files(tmp_path, timed=False)
    said = call(capsys, "idm", robot, motion).err
    assert float(cells(said)[1]) == pytest.approx(BY_ROWS, rel=PRINTED)
    assert f"row {len(TIME)}" in said
    for words in ([], ["--loads"], ["--by-effect"]):
        assert (
            "the table has no times: RMS values are means over its rows"
            in call(capsys, "idm", robot, motion, *words).err
        )
    assert STATISTICS["rms"](FORCE, None) == pytest.approx(BY_ROWS, rel=ROUNDING)


def test_blocks_continue_each_other() -> None:
    means = Means()
    for block in np.array_split(np.arange(len(TIME)), 9):
        means.add(TIME[block], np.column_stack([FORCE[block] ** 2, TIME[block]]))
    assert means.mean == pytest.approx([RMS**2, END / 2], rel=ROUNDING)
    assert means.duration == pytest.approx(END, rel=ROUNDING)
