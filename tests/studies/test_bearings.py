"""Loads of bearings: of a pendulum by its own equation, of closed loops as far as they are determined."""

import csv
from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.structure.robot import HybridRobot
from hybridyn.studies.bearings import Bearings, bearing_rows
from tests.support.command_line import call
from tests.support.files import beginning, save

ROUNDING = 1e-12
TIME = np.linspace(0.0, 1.0, 21)
ANGLE, RATE, CHANGE = 1.2 * np.sin(TIME), 1.2 * np.cos(TIME), -1.2 * np.sin(TIME)
MASS, LENGTH, ASIDE, GRAVITY = 2.0, 0.7, 0.3, 9.81
#: A rod that turns about y; its mass is beside the plane in which its frame turns.
ROD = f"""<robot name="rod">
  <link name="base"/>
  <link name="rod"><inertial><origin xyz="{LENGTH} {ASIDE} 0"/><mass value="{MASS}"/>
    <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="turn" type="revolute"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="100" velocity="10"/></joint>
</robot>
"""


def loads_of(robot: HybridRobot, *state: np.ndarray) -> Bearings:
    """Return the loads of a motion, in two blocks."""
    _, inner = hybridyn.idm(robot, *state, reactions=True)
    rows, out = bearing_rows(robot, inner), Bearings(robot)
    for block in (slice(0, 8), slice(8, None)):
        out.add(TIME[block], block.start, rows[block])
    return out


def test_a_hinge_bears_what_its_rod_needs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A positive angle is downwards; the mass beside the plane of the motion tilts the axis."""
    robot = hybridyn.load(save(tmp_path, ROD, "rod.urdf"))
    (load,) = loads_of(robot, ANGLE[:, None], RATE[:, None], CHANGE[:, None]).loads()
    along = -MASS * (LENGTH * RATE**2 + GRAVITY * np.sin(ANGLE))
    across = MASS * (LENGTH * CHANGE - GRAVITY * np.cos(ANGLE))
    radial = np.hypot(along, across)
    assert load.joint == "turn"
    assert np.isclose(load.peaks["radial"].value, radial.max(), rtol=ROUNDING, atol=0)
    assert load.peaks["radial"].at == TIME[radial.argmax()]
    rms = np.sqrt(np.trapezoid(radial**2, TIME))
    assert np.isclose(load.rms["radial"], rms, rtol=ROUNDING, atol=0)
    assert load.peaks["axial"].value < ROUNDING * radial.max()
    assert np.isclose(load.peaks["tilt"].value, ASIDE * radial.max(), rtol=ROUNDING, atol=0)
    (tmp_path / "swing.csv").write_text("turn/position,turn/velocity,turn/acceleration\n0,0,1\n0.5,1,0\n")
    said = call(capsys, "idm", tmp_path / "rod.urdf", tmp_path / "swing.csv", "--bearings", "-q").out
    assert "  0 N  " in said  # the axial load, which is rounding


def test_a_loop_in_a_plane_shares_what_acts_out_of_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The command ranks joints by force, and says which loads have no number."""
    words = "idm", "five_bar", beginning(tmp_path, "five_bar", 50), "--bearings", "-q"
    out = call(capsys, *words, "-o", tmp_path / "b.csv", "--plot", tmp_path / "b.html").out
    with open(tmp_path / "b.csv", encoding="utf-8") as file:
        told = list(csv.DictReader(file))
    forces = [float(row["peak_radial"]) for row in told]
    assert forces == sorted(forces, reverse=True)
    assert {row["peak_axial"] for row in told} == {row["peak_tilt"] for row in told} == {""}
    assert out.count("shared") == 2 * len(told) + 1
    call(capsys, "plot", tmp_path / "b.csv", "-o", tmp_path / "again.svg")
    for name in ("b.html", "again.svg"):
        drawn = (tmp_path / name).read_text()
        assert ("radial [N]" in drawn, "axial [N]" in drawn) == (True, False)  # what is shared has no bar
    robot = hybridyn.load("five_bar")
    assert {row["joint"] for row in told} == {
        joint.name for joint in robot.records.values() if joint.kind.single
    }


def test_slides_have_a_normal_force_and_a_moment() -> None:
    robot = hybridyn.load("gough_stewart")
    motion = {name: (0.01 * np.sin(TIME + i), 0.01 * np.cos(TIME + i), -0.01 * np.sin(TIME + i))
              for i, name in enumerate(robot.motors)}  # fmt: skip
    q, v, a = hybridyn.assemble(robot, motors=motion)
    found = {load.joint: load for load in loads_of(robot, q, v, a).loads()}
    inner = hybridyn.idm(robot, q, v, a, reactions=True)[1]
    for name in robot.motors:
        axis = robot.records[name].axis
        force, moment = np.split(inner.joints[name], 2, axis=1)
        normal = np.linalg.norm(np.cross(axis, force), axis=1)
        peaks = found[name].peaks
        assert {*peaks} == {"radial", "tilt"}
        assert np.isclose(peaks["radial"].value, normal.max(), rtol=1e-6, atol=0)  # ties within the part TIE
        assert np.isclose(peaks["tilt"].value, np.linalg.norm(moment, axis=1).max(), rtol=1e-6, atol=0)


def test_limits_that_the_motion_leaves_are_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    save(tmp_path, ROD, "rod.urdf")
    (tmp_path / "far.csv").write_text("turn/position,turn/velocity,turn/acceleration\n2.5,0,0\n")
    words = "idm", tmp_path / "rod.urdf", tmp_path / "far.csv", "--bearings", "-q", "--fail-on", "limit"
    assert "joint 'turn' leaves its limits: position of 2.5 rad" in call(capsys, *words, status=1).out


def test_a_robot_without_bearings_has_no_loads(tmp_path: Path) -> None:
    joint = ROD.replace('type="revolute"', 'type="planar"').replace('xyz="0 1 0"', 'xyz="0 0 1"')
    robot = hybridyn.load(save(tmp_path, joint, "flat.urdf"))
    q, still = np.tile(robot.home, (len(TIME), 1)), np.zeros((len(TIME), robot.nv))
    assert loads_of(robot, q, still, still).loads() == []
