"""What is told of a motion that ends before a singular posture: the joint, and how far it is from there."""

import re
from functools import partial
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from hybridyn import AssemblyError
from tests.assembly.test_angles import arm
from tests.robots.as_written import Sheet, point
from tests.support.comparing import close_to, refused
from tests.support.samples import slow

#: Relative, of what is told: the angle that is left is the first term of a series, and the next one is
#: smaller by a third of the angle's square. The angle is up to half a radian.
FIRST = 0.1
REACHED = 1e-10  # [rad]
#: Of what is told with two digits.
TOLD = 0.05


@pytest.mark.parametrize(("start", "stop"), [(-0.9, -1.06), (-0.9, -1.2), (-1.0, -1.5)])
def test_a_tool_past_its_reach_tells_how_far_the_joint_is_from_there(
    tmp_path: Path, start: float, stop: float
) -> None:
    """Around an axis inclined by 30 degrees, sin(pitch) = (cos q - 1) sin(60 deg) / 2: 60 degrees at most.

    No sum of lengths proves it.
    """
    s, axis = Sheet("base"), point(0.5, 0.0, np.sqrt(0.75))
    s.joint("revolute", "base", "turning", point(0, 0, 0), axis, motor=True, limits=(-2.0, 2.0))
    s.joint("fixed", "turning", "tool", point(0.5, 0, 0))
    path = tmp_path / "inclined.urdf"
    path.write_text(s.text("inclined"))
    robot, rows = hybridyn.load(path), np.array([start, stop])

    def turned(pitch: float) -> float:
        return float(np.arccos(1 + np.sin(pitch) / np.sqrt(0.1875)))

    error = refused(
        partial(
            hybridyn.assemble, robot, platforms={"tool": ({"pitch": rows},)}, guess=np.array([turned(start)])
        ),
        AssemblyError,
        r"pitch of 'tool': not reached at sample 1: .* joint 'turning_joint' .* is about \S+ rad from a sing",
    )
    (outside,) = re.findall(r"joint 'turning_joint' .* is (\S+) rad outside its limits there", str(error))
    close_to(float(outside), np.pi - 2.0, TOLD)
    done = float(re.findall(r"ends at (\S+) % of the way", str(error))[0]) / 100
    close_to(error.distance, np.pi - turned(start + done * (stop - start)), FIRST)


def past_the_pole(tilt: float, rows: int) -> tuple[dict[str, np.ndarray], np.ndarray, list[np.ndarray]]:
    """Return orientations that pass the pole of a wrist at an angle, the first posture, and the rotations."""
    turned = pin.exp3(np.array([0.0, tilt, 0.0]))
    every = [pin.exp3(np.array([x, 0.0, 0.0])) @ turned for x in np.linspace(-0.5, 0.5, rows)]
    vectors, R = np.array([pin.log3(one) for one in every]).T, every[0]
    guess = np.array([np.arctan2(R[1, 2], R[0, 2]), np.arccos(R[2, 2]), np.arctan2(R[2, 1], -R[2, 0])])
    return dict(zip(("rx", "ry", "rz"), vectors, strict=True)), guess, every


@pytest.mark.slow
def test_a_wrist_passes_its_pole_in_some_rows(tmp_path: Path) -> None:
    """At a hundredth of a radian; its first and last joints then turn by nearly half a turn."""
    robot, (pose, guess, _) = arm(tmp_path, "zyz"), past_the_pole(1e-2, 21)
    q = hybridyn.assemble(robot, platforms={"l2": (pose,)}, guess=guess)[0]
    close_to(q[-1], guess * [-1.0, 1.0, -1.0], REACHED)


@pytest.mark.parametrize("tilt", [slow(1e-2), 1e-3])
def test_a_wrist_that_passes_its_pole_in_one_row_tells_how_far_it_is(tmp_path: Path, tilt: float) -> None:
    """The second of three joints is the angle from the pole, where the first and the last have one axis."""
    robot, (pose, guess, ends) = arm(tmp_path, "zyz"), past_the_pole(tilt, 2)
    words = r"at sample 1 .* joint 'j1' of module '\w+' is about \S+ rad from a singular posture"
    error = refused(
        partial(hybridyn.assemble, robot, platforms={"l2": (pose,)}, guess=guess), AssemblyError, words
    )
    done = float(re.findall(r"ends at (\S+) % of the way", str(error))[0]) / 100
    there = ends[0] @ pin.exp3(done * pin.log3(ends[0].T @ ends[1]))
    close_to(error.distance, np.arccos(there[2, 2]), FIRST)
