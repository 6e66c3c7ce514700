"""Orientations near half a turn from the posture before: they are reached by the shorter turn."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from hybridyn import HybridRobot
from hybridyn.spatial import Array
from tests.assembly.test_angles import arm, placed
from tests.support.samples import slow

REACHED = 1e-10  # [rad]
#: What is beyond half a turn, or lacks to it; at half a turn itself both ways are as long.
BESIDE = (-0.3, -1e-3, -1e-6, 1e-6, 1e-3, 0.3)
#: Arms by their axes, with a posture in which a turn about the first axis moves the first joint only.
ARMS = {"y": (0.0,), "zyz": (0.3, 0.8, 0.2), "zyxzyz": (0.3, 0.8, 0.2, -0.4, 0.9, 0.5)}


def forms(R: Array) -> dict[str, dict[str, float]]:
    """Return an orientation in all complete forms."""
    angles, quaternion, vector = pin.rpy.matrixToRpy(R), pin.Quaternion(R).coeffs(), pin.log3(R)
    return {
        "angles": dict(zip(("roll", "pitch", "yaw"), angles, strict=True)),
        "quaternion": dict(zip(("qx", "qy", "qz", "qw"), quaternion, strict=True)),
        "opposite": dict(zip(("qx", "qy", "qz", "qw"), -quaternion, strict=True)),
        "vector": dict(zip(("rx", "ry", "rz"), vector, strict=True)),
    }


def asked(robot: HybridRobot, link: str, pose: dict[str, Array | float], guess: Array) -> Array:
    """Return the positions for an orientation; joints beyond the third are held."""
    held = {name: guess[i] for i, name in enumerate(robot.joints[3:], 3)}
    return hybridyn.assemble(robot, motors=held, platforms={link: (pose,)}, guess=guess)[0]


@pytest.mark.parametrize("beside", BESIDE)
@pytest.mark.parametrize("axes", [*ARMS])
def test_an_orientation_is_reached_by_the_shorter_turn(tmp_path: Path, axes: str, beside: float) -> None:
    """Beyond half a turn the first joint goes the other way; no form of the orientation is mirrored."""
    robot, guess, link = arm(tmp_path, axes), np.array(ARMS[axes]), f"l{len(axes) - 1}"
    turn = np.pi + beside
    wanted = guess.copy()
    wanted[0] += turn if beside < 0 else turn - 2 * np.pi
    R = placed(robot, wanted[None], link)[0]
    for form, pose in forms(R).items():
        q = asked(robot, link, pose, guess)
        assert np.abs(q - wanted).max() < REACHED, form


def test_at_half_a_turn_the_orientation_is_the_one_that_is_given(tmp_path: Path) -> None:
    """Whichever way the joint goes."""
    robot, guess = arm(tmp_path, "zyz"), np.array(ARMS["zyz"])
    R = placed(robot, guess[None] + [np.pi, 0.0, 0.0], "l2")[0]
    for form, pose in forms(R).items():
        q = asked(robot, "l2", pose, guess)
        assert np.abs(pin.log3(placed(robot, q[None], "l2")[0].T @ R)).max() < REACHED, form
        assert np.abs(q[1:] - guess[1:]).max() < REACHED, form


@pytest.mark.parametrize(("axes", "step"), [("y", 3.0), *(slow("zyz", step) for step in (0.5, 1.5, 3.0))])
def test_rows_less_than_half_a_turn_apart_turn_on(tmp_path: Path, axes: str, step: float) -> None:
    """Over a turn and a half, in one direction; a lone angle, too."""
    robot, guess, link = arm(tmp_path, axes), np.array(ARMS[axes]), f"l{len(axes) - 1}"
    way = np.arange(0.0, 9.5, step)
    wanted = guess + way[:, None] * np.eye(len(axes))[0]
    each = [forms(R) for R in placed(robot, wanted, link)]
    for form in ("angles", "quaternion", "vector"):
        rows = {name: np.array([one[form][name] for one in each]) for name in each[0][form]}
        assert np.abs(asked(robot, link, rows, guess) - wanted).max() < REACHED, form
    single = arm(tmp_path, "y")
    q = asked(single, "l0", {"pitch": way}, np.zeros(1))
    assert np.abs(q[:, 0] - way).max() < REACHED


def test_a_complete_orientation_turns_about_a_fixed_axis_between_rows(tmp_path: Path) -> None:
    """Against rows along that turn; numbers that change steadily pass the pole on its other side."""
    robot, start, end = arm(tmp_path, "zyx"), np.array([1.1, -0.9, 0.7]), np.array([-2.3, -0.7, -1.0])
    R, part = pin.rpy.rpyToMatrix(start), np.linspace(0.0, 1.0, 65)[:, None]
    turn = pin.log3(pin.rpy.rpyToMatrix(end) @ R.T)
    along = np.unwrap([pin.rpy.matrixToRpy(pin.exp3(f * turn) @ R) for f in part], axis=0)
    steady = start + part * (end - start)
    assert np.abs(along[-1] - end - [2 * np.pi, 0.0, 0.0]).max() < REACHED  # the roll, by a whole turn
    for rows, there in ((end[None], along), (along, along), (steady, steady)):
        pose = dict(zip(("roll", "pitch", "yaw"), rows.T, strict=True))
        q = asked(robot, "l2", pose, start[::-1])
        assert np.abs(q[-1] - there[-1][::-1]).max() < REACHED


@pytest.mark.parametrize("beside", BESIDE)
def test_a_direction_is_reached_by_the_shorter_turn(tmp_path: Path, beside: float) -> None:
    """That of an axis, or a lone angle, of one joint."""
    robot, turn = arm(tmp_path, "y"), np.pi + beside
    wanted = turn if beside < 0 else turn - 2 * np.pi
    for pose in (
        {"xx": np.cos(turn), "xy": 0.0, "xz": -np.sin(turn)},
        {"zx": np.sin(turn), "zy": 0.0, "zz": np.cos(turn)},
        {"pitch": turn},
    ):
        assert np.abs(asked(robot, "l0", pose, np.zeros(1)) - wanted).max() < REACHED
