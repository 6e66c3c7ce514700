"""What `info` remarks about a robot: one small wrong robot per remark, and none for the shipped ones."""

from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.studies.check.loops import home_residuals
from hybridyn.studies.check.remarks import findings
from tests import ROOT

URDF = ROOT / "urdf"
INERTIAL = """<inertial><origin xyz="{x} 0 0"/><mass value="{mass}"/>
  <inertia ixx="{mass}" iyy="{mass}" izz="{mass}" ixy="0" ixz="0" iyz="0"/></inertial>"""


SQUARE = (np.pi / 2, -np.pi / 2, np.pi / 2)
FLAT = (0.0, 0.0, 0.0)


def four_bar(
    tmp_path: Path,
    turns: tuple[float, float, float],
    *,
    ground: float = 1.5,
    coupler: float = 1.5,
    mass: float = 1.0,
    motor: str = "crank",
) -> hybridyn.HybridRobot:
    """Return a planar four-bar with cranks of one metre, whose joints stand at these angles at home."""

    def link(name: str, reach: float, mass: float) -> str:
        return f'<link name="{name}">{INERTIAL.format(x=reach / 2, mass=mass)}</link>'

    def joint(name: str, parent: str, child: str, x: float, turn: float) -> str:
        return f"""<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>
          <origin xyz="{x} 0 0" rpy="0 0 {float(turn)!r}"/><axis xyz="0 0 1"/>
          <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>"""

    path = tmp_path / "four_bar.urdf"
    path.write_text(
        '<robot name="four_bar">'
        + link("ground", ground, 1.0)
        + link("left", 1.0, mass)
        + link("middle", coupler, mass)
        + link("right", 1.0, mass)
        + joint("crank", "ground", "left", 0.0, turns[0])
        + joint("elbow", "left", "middle", 1.0, turns[1])
        + joint("rocker", "ground", "right", ground, turns[2])
        + f"""<loop name="pin" type="revolute"><axis xyz="0 0 1"/>
          <predecessor link="middle"><origin xyz="{coupler} 0 0"/></predecessor>
          <successor link="right"><origin xyz="1 0 0"/></successor></loop></robot>"""
    )
    return hybridyn.load(path, motors=[motor])


def test_a_sound_robot_has_none(tmp_path: Path) -> None:
    robot = four_bar(tmp_path, SQUARE)
    assert home_residuals(robot) == pytest.approx([0.0], abs=1e-12)
    assert findings(robot) == []


def test_open_loops_at_home(tmp_path: Path) -> None:
    (text,) = findings(four_bar(tmp_path, SQUARE, coupler=1.2))
    assert "its loops are open by 0.15 of its size (2 m) at the home posture" in text
    assert "model.toml" in text


def test_a_singular_home(tmp_path: Path) -> None:
    (text,) = findings(four_bar(tmp_path, FLAT))
    assert "its closures lose rank at the home posture" in text


def test_motors_that_lose_a_direction_at_home(tmp_path: Path) -> None:
    """Crank and coupler in line: a dead centre, where the rocker stands still and cannot drive the crank."""
    alpha = np.arccos(0.875)  # cosine rule with sides 2, 1.5, 1
    beta = np.arctan2(2.0 * np.sin(alpha), 2.0 * np.cos(alpha) - 1.5)
    dead = (alpha, 0.0, beta)
    assert findings(four_bar(tmp_path, dead, coupler=1.0, motor="crank")) == []
    (text,) = findings(four_bar(tmp_path, dead, coupler=1.0, motor="rocker"))
    assert "can still move at the home posture when its motors are locked" in text


def test_the_part_without_mass_is_named(tmp_path: Path) -> None:
    """A wheel without mass on the coupler spins without resistance; the rest of the four-bar has its mass."""
    path = tmp_path / "wheel.urdf"
    four_bar(tmp_path, SQUARE)
    wheel = """<link name="wheel"/><joint name="axle" type="revolute">
      <parent link="middle"/><child link="wheel"/><axis xyz="0 0 1"/>
      <limit lower="-3" upper="3" effort="1" velocity="1"/></joint></robot>"""
    path.write_text((tmp_path / "four_bar.urdf").read_text().replace("</robot>", wheel))
    link, text = findings(hybridyn.load(path, motors=["crank"]))
    assert link.startswith("link 'wheel' moves and has no mass")
    assert "none of its bodies has mass" in text
    assert text.startswith("module 'wheel'")


def test_a_joint_without_mass_that_carries_mass_is_no_finding(tmp_path: Path) -> None:
    """A wrist: the first of two joints has its mass on the next one."""
    path = tmp_path / "wrist.urdf"
    joint = (
        '<joint name="{0}" type="continuous"><parent link="{1}"/><child link="{2}"/><axis xyz="{3}"/></joint>'
    )
    path.write_text(
        '<robot name="wrist"><link name="base"/><link name="cross"/><link name="hand">'
        + INERTIAL.format(x=0.1, mass=1)
        + "</link>"
        + joint.format("pitch", "base", "cross", "0 1 0")
        + joint.format("roll", "cross", "hand", "1 0 0")
        + "</robot>"
    )
    assert findings(hybridyn.load(path)) == []


def test_bodies_without_mass(tmp_path: Path) -> None:
    nothing, text = findings(four_bar(tmp_path, SQUARE, mass=0.0))
    assert "move and have no mass" in nothing
    assert "none of its bodies has mass" in text


@pytest.mark.parametrize("name", sorted(path.name for path in URDF.glob("*.urdf.xacro")))
def test_shipped_robots_have_none(name: str) -> None:
    assert findings(hybridyn.load(URDF / name)) == []
