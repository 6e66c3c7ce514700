"""Robots that are singular in every posture, and postures that only look like it.

Claim: a Gough-Stewart of similar hexagons is told to be architecturally singular by `load` and by `findings`
(Merlet, Parallel Robots, 2006, section 6.5: the six legs' lines always belong to one linear complex), and
nothing else that we ship or draw is. No number is claimed but the motors' share in the direction that they
lose: rounding for the one (1e-12), more than 1e-5 (`SINGULAR_POSTURE`) for the others.
"""

from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.assembly.motor_share import SINGULAR_POSTURE, architecturally_singular, motor_share
from hybridyn.description import Description
from hybridyn.structure.building import build_robot
from tests.hard.claims import Claim
from tests.hard.closed_forms import changed, changed_text
from tests.judges.remarks import findings, module_findings
from tests.robots.mechanisms import KINDS, random_mechanism
from tests.robots.shipped import ROBOTS, shipped
from tests.support.comparing import refused
from tests.support.files import save
from tests.support.samples import some

ROUNDING = 1e-12


def share_of_motors(robot: hybridyn.HybridRobot) -> float:
    """Return the greatest share of the motors, over generic postures, in the direction that they lose."""
    m = robot.modules[0].mechanism
    return float(motor_share(robot.modules[0], m.basis(m.generic_K).Psi).max())


def hexagons(base: float, platform: float) -> Description:
    return changed("gough_stewart", base_half_angle=str(base), platform_half_angle=str(platform))


@pytest.mark.parametrize("angle", [12, 30, 45])
def test_similar_hexagons(angle: float, claim: Claim) -> None:
    """A regular one (30 degrees), and two that are not."""
    robot = build_robot(hexagons(angle, angle))
    claim(f"similar hexagons, {angle} deg", "motors' share in a motion", share_of_motors(robot), ROUNDING)
    (text,) = findings(robot)
    assert "architecturally singular" in text
    q, rest = robot.home, np.zeros(robot.nv)
    caught = refused(
        lambda: hybridyn.idm(robot, q, rest, rest), hybridyn.SingularityError, "its motors lose a direction"
    )
    assert (caught.condition or 0.0) > 1e10
    assert np.isfinite(hybridyn.idm(robot, q, rest, rest, on_singular="least-norm")).all()


@pytest.mark.parametrize("platform", [12, 48])
def test_load_says_so(platform: float, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """One warning for the robot that it is true of, none for the one with other numbers."""
    path = save(
        tmp_path,
        changed_text("gough_stewart", base_half_angle="12", platform_half_angle=str(platform)),
        "hexagons.urdf.xacro",
    )
    hybridyn.load(path)
    said = [record.getMessage() for record in caplog.records]
    if platform == 12:
        assert len(said) == 1
        assert said[0].startswith("module 'm1_platform' is architecturally singular")
    else:
        assert said == []


@pytest.mark.parametrize("name", ROBOTS)
def test_shipped_robots_are_not(name: str, claim: Claim) -> None:
    robot = build_robot(shipped(name))
    assert not [one.code for one in module_findings(robot)]
    least = [motor_share(m, m.mechanism.basis(m.mechanism.generic_K).Psi) for m in robot.modules]
    share = min(float(np.median(s)) for s in least if s is not None)
    claim(name, "reciprocal of the motors' share in a motion", 1 / share, 1 / SINGULAR_POSTURE)


@pytest.mark.parametrize("kind", some(KINDS))
def test_random_mechanisms_are_not(kind: str) -> None:
    robot = build_robot(random_mechanism(0, kind=kind))
    assert [architecturally_singular(module) for module in robot.modules] == [""] * len(robot.modules)


def test_different_hexagons_are_not_but_for_ninety_degrees(claim: Claim) -> None:
    """Half-angles 10 and 50 degrees: fine in general; the posture at 90 degrees of yaw has its own tests."""
    robot = build_robot(hexagons(10, 50))
    assert findings(robot) == []
    share = 1 / share_of_motors(robot)
    claim(
        "hexagons of 10 and 50 deg",
        "reciprocal of the motors' share in a motion",
        share,
        1 / SINGULAR_POSTURE,
    )
