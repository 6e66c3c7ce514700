"""Postures where closures lose rank: the parallelogram at its change point."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest

import hybridyn
from tests.comparing import refused
from tests.files import save

TOLERANCE = 1e-13  # rounding of a closed form with terms of order twenty

BAR = """<link name="{name}"><inertial><origin xyz="{half} 0 0"/><mass value="1"/>
  <inertia ixx="0.001" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
HINGE = """<joint name="{name}" type="revolute" independent="{driven}"><parent link="{parent}"/>
  <child link="{child}"/><origin xyz="{at} 0 0"/><axis xyz="0 0 1"/>
  <limit lower="-9" upper="9" effort="99" velocity="9"/></joint>"""


def parallelogram(folder: Path) -> hybridyn.HybridRobot:
    """Crank and rocker of 1 m, coupler and ground of 2 m, bars of 1 kg with 0.1 kg m^2 about the middle."""
    parts = [
        '<robot name="parallelogram"><link name="ground"/>',
        *(
            BAR.format(name=name, half=half)
            for name, half in (("crank", 0.5), ("coupler", 1), ("rocker", 0.5))
        ),
        HINGE.format(name="a", driven="true", parent="ground", child="crank", at=0),
        HINGE.format(name="b", driven="false", parent="crank", child="coupler", at=1),
        HINGE.format(name="c", driven="false", parent="ground", child="rocker", at=2),
        """<loop name="l" type="revolute"><predecessor link="coupler"><origin xyz="2 0 0"/></predecessor>
        <successor link="rocker"><origin xyz="1 0 0"/></successor><axis xyz="0 0 1"/></loop></robot>""",
    ]
    return hybridyn.load(save(folder, "".join(parts), "parallelogram.urdf"), gravity=(0, -9.81, 0))


def effort(angle: float, acceleration: float) -> float:
    """Closed form: inertia 2 (0.1 + 0.25) + 1 about the crank, weight on an arm of (0.5 + 1 + 0.5) cos."""
    return 1.7 * acceleration + 2.0 * 9.81 * np.cos(angle)


@pytest.mark.parametrize("angle", [0.1, 1e-3, 1e-6])
def test_the_way_to_the_change_point(tmp_path: Path, angle: float) -> None:
    """The effort stays right however near; the loss of digits is that of the pivot, eps / angle."""
    robot = parallelogram(tmp_path)
    q, v, a = np.array([angle, -angle, angle]), np.array([1.0, -1.0, 1.0]), np.array([0.5, -0.5, 0.5])
    lost = TOLERANCE + 10 * np.finfo(float).eps / angle
    assert hybridyn.idm(robot, q, v, a) == pytest.approx(effort(angle, 0.5), rel=lost)


def test_the_change_point_itself(tmp_path: Path) -> None:
    """Two motions are possible there; the one that the linkage is on says the effort, or nothing does."""
    robot = parallelogram(tmp_path)
    q, v, a = np.zeros(3), np.array([1.0, -1.0, 1.0]), np.array([0.5, -0.5, 0.5])
    for call in (partial(hybridyn.idm, robot, q, v, a), partial(hybridyn.ddm, robot, q, v, np.zeros(1))):
        refused(call, hybridyn.SingularityError, "closures lose rank at sample 0", what="closures")
    tau = hybridyn.idm(robot, q, v, a, on_singular="least-norm")
    assert tau == pytest.approx(effort(0.0, 0.5), rel=TOLERANCE)
