"""Robots whose loops are open at home are closed before they are written, or refused."""

from __future__ import annotations

from pathlib import Path

import pytest

import hybridyn
from hybridyn import ModelError, closure_residual, convert
from hybridyn.structure.building import build_robot
from tests.command_line import call
from tests.comparing import refused
from tests.conversion.features import coupled
from tests.extras import needs
from tests.robot_texts import CLOSED_FOUR_BAR, FOUR_BAR, save

#: Residual of a closed posture that went through a file.
CLOSED = 1e-12
#: A coupler that is too short for a drive at 2 rad.
SHORT = FOUR_BAR.replace(
    '<predecessor link="coupler"><origin xyz="1.5', '<predecessor link="coupler"><origin xyz="0.6'
)
OPEN = "'pin' is open at home by "


def four_bar(folder: Path, text: str, drive: float) -> Path:
    """Write a four-bar whose home states the position of its motor alone."""
    save(folder, f"[home]\ndrive = {drive}\n", "four_bar.model.toml")
    return save(folder, text)


@pytest.mark.parametrize("ending", [".urdf", ".sdf", ".xml", ".usda"])
def test_open_loops_are_closed_with_the_motors_where_they_are(ending: str, tmp_path: Path) -> None:
    if ending in (".xml", ".usda"):
        needs({".xml": "mjcf", ".usda": "usd"}[ending])
    file = four_bar(tmp_path, FOUR_BAR, 0.3)
    before = hybridyn.load(file)
    assert closure_residual(before, before.home) > 0.1
    done = convert(file, tmp_path / f"out{ending}")
    (note,) = (line for line in done.notes if "open at home" in line)
    assert note.startswith(OPEN)
    assert note.endswith("; written closed, with the motors where they are")
    after = hybridyn.load(done.files[0])
    assert closure_residual(after, after.home) < CLOSED
    assert after.description.home["drive"] == pytest.approx((0.3,), abs=CLOSED)


def test_a_home_that_is_closed_stays(tmp_path: Path) -> None:
    done = convert(save(tmp_path, CLOSED_FOUR_BAR), tmp_path / "out.urdf")
    assert not any("open at home" in note for note in done.notes)
    assert hybridyn.load(done.files[0]).description.home == {}


def test_couplings_are_closed(tmp_path: Path) -> None:
    """Joint "two" turns twice as far as "one", which is at 0.3 rad, plus half a radian."""
    robot = build_robot(coupled("two", ("two", 1.0), ("one", -2.0), offset=0.5))
    done = convert(robot, tmp_path / "out.urdf")
    assert any(note.startswith("'two' is open at home by 0.55 ") for note in done.notes)
    home = hybridyn.load(done.files[0]).description.home
    assert (*home["one"], *home["two"], *home["rail"]) == pytest.approx((0.3, 1.1, 0.1), abs=CLOSED)


def test_loops_that_cannot_be_closed_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, out = four_bar(tmp_path, SHORT, 2.0), tmp_path / "out.xml"
    refused(lambda: convert(file, out), ModelError, OPEN, element="pin")
    mend = "state a closed home posture: [home] in model.toml"
    says = ["no posture near home closes it with the motors where they are", mend]
    call(capsys, "convert", file, "-o", out, status=1, says=says)
    assert not out.exists()
