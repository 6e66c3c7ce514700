"""Rows of small singular value: a constraint where home closes to the last digit, else a file's rounding."""

import logging
from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn import HybridRobot
from hybridyn.errors import ModelError
from hybridyn.spatial import Array
from tests.support.command_line import call
from tests.support.comparing import refused
from tests.support.files import save

MASS = (
    '<inertial><origin xyz="{x} 0 0"/><mass value="1"/>'
    '<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.03"/></inertial>'
)
JOINT = (
    '<joint name="{name}" type="revolute"><origin xyz="{xyz}" rpy="0 0 {turn}"/><parent link="{parent}"/>'
    '<child link="{child}"/><axis xyz="0 0 1"/><limit lower="-9" upper="9" effort="9" velocity="9"/></joint>'
)
ROWS = (
    '<loop name="{name}" type="rows" rows="{rows}"><predecessor link="{a}"><origin xyz="{pa}"/></predecessor>'
    '<successor link="{b}"><origin xyz="{pb}"/></successor></loop>'
)


def pinned(folder: Path, lever: float, off: float = 0.0) -> Path:
    """Write a parallelogram, and a wheel on its crank's axis that a pin at a short lever carries along.

    The pin's one row has the lever for its singular value; `off` is what rounding leaves open at home.
    """
    names = ("crank", "coupler", "rocker", "wheel")
    parts = [
        '<link name="ground"/>',
        *(f'<link name="{name}">{MASS.format(x=0.3)}</link>' for name in names),
        JOINT.format(name="drive", turn=1, xyz="0 0 0", parent="ground", child="crank"),
        JOINT.format(name="elbow", turn=-1, xyz="0.5 0 0", parent="crank", child="coupler"),
        JOINT.format(name="swing", turn=1, xyz="0.8 0 0", parent="ground", child="rocker"),
        JOINT.format(name="turn", turn=1, xyz="0 0 0.1", parent="ground", child="wheel"),
        ROWS.format(name="tip", rows="tx ty", a="coupler", pa="0.8 0 0", b="rocker", pb="0.5 0 0"),
        ROWS.format(name="pin", rows="ty", a="crank", pa=f"{lever} 0 0", b="wheel", pb=f"{lever} {off} 0"),
    ]
    return save(folder, f'<robot name="pinned">{"".join(parts)}</robot>', "pinned.urdf")


def accelerating_apart(robot: HybridRobot) -> tuple[float, Array]:
    """Return how far crank and wheel accelerate apart over the largest acceleration, moving on together."""
    v = np.array([{"drive": 0.7, "elbow": -0.7, "swing": 0.7, "turn": 0.7}[name] for name in robot.joints])
    a = hybridyn.ddm(
        robot, robot.home, v, np.array([0.4]), wrenches={"wheel": np.array([0, 0, 0, 0, 0, 3.0])}
    )
    at = robot.joint_index
    return abs(a[at["drive"]] - a[at["turn"]]) / np.abs(a).max(), a


@pytest.mark.parametrize("lever", [2e-5, 8e-5, 1.6e-4])
def test_a_row_counts_where_home_closes_to_the_last_digit(
    lever: float, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """The wheel follows the crank; taken for rounding it had a motion of its own, or stopped the load."""
    with caplog.at_level(logging.WARNING, "hybridyn"):
        robot = hybridyn.load(pinned(tmp_path, lever), motors=["drive"])
    assert robot.mobility == 1
    assert accelerating_apart(robot)[0] < 1e-9
    assert "count as independent: its loops are closed to" in caplog.text
    q, _, _ = hybridyn.assemble(robot, motors={"drive": np.linspace(0.0, 0.5, 5)})
    at = robot.joint_index
    assert np.abs(q[:, at["drive"]] - q[:, at["turn"]]).max() < 1e-9


def test_a_row_is_rounding_where_home_is_open_by_its_share(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING, "hybridyn"):
        robot = hybridyn.load(pinned(tmp_path, 8e-5, off=1e-6), motors=["drive"])
    assert robot.mobility == 2
    assert "count as dependent, as rounding in the file" in caplog.text


def skewed_slides(folder: Path, skew: float) -> Path:
    """Write two slides in a row that are closed in a plane; they are locked if their axes are skew."""
    slide = (
        '<joint name="{name}" type="prismatic"><parent link="{parent}"/><child link="{child}"/>'
        '<axis xyz="1 {y} 0"/><limit lower="-1" upper="1" effort="9" velocity="9"/></joint>'
    )
    parts = [
        '<link name="ground"/>',
        *(f'<link name="{name}">{MASS.format(x=0.3)}</link>' for name in ("lower", "upper")),
        slide.format(name="one", parent="ground", child="lower", y=0),
        slide.format(name="two", parent="lower", child="upper", y=skew),
        ROWS.format(name="tie", rows="tx ty", a="ground", pa="0.5 0 0", b="upper", pb="0.5 0 0"),
    ]
    return save(folder, f'<robot name="slides">{"".join(parts)}</robot>', "slides.urdf")


def test_rows_may_lock_a_module_where_home_closes_to_the_last_digit(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING, "hybridyn"):
        robot = hybridyn.load(skewed_slides(tmp_path, 5e-3), motors=["one"])
    assert robot.mobility == 0
    assert "count as independent and lock it: its loops are closed to" in caplog.text
    assert hybridyn.load(skewed_slides(tmp_path, 5e-3), motors=["one"], rank_tolerance=0.1).mobility == 1
    assert hybridyn.load(skewed_slides(tmp_path, 0.0), motors=["one"]).mobility == 1


def test_rows_that_may_be_rounding_and_would_lock_a_module_are_asked_for(tmp_path: Path) -> None:
    refused(
        lambda: hybridyn.load(skewed_slides(tmp_path, 5e-4), motors=["one"]),
        ModelError,
        "rank of its closures is in doubt",
    )


def test_the_users_word_goes_before_the_evidence(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING, "hybridyn"):
        robot = hybridyn.load(pinned(tmp_path, 8e-5), motors=["drive"], rank_tolerance=1e-3)
    assert robot.mobility == 2
    assert not caplog.text


def test_exact_loops_are_loaded_without_a_word(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING, "hybridyn"):
        assert hybridyn.load("five_bar").modules[0].mechanism.rank_decision == ""
    assert not caplog.text


def test_info_says_how_rows_were_counted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = call(capsys, "info", pinned(tmp_path, 8e-5))
    assert "count as independent" in " ".join(said.out.split())
