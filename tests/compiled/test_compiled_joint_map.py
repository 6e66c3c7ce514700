"""The map between motors and output joints on the compiled path: numbers, words, modules that stay."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.compiled.equations.states import moving_states
from tests.comparing import SOLVED, close_to
from tests.compiled.test_compiled_quantities import ELBOWS, error_of
from tests.quantities.ankle import JOINTS, ankle, leg

ARRAYS = (
    "joint_positions", "motor_positions", "motors_per_joints", "joints_per_motors", "curvature",
)  # fmt: skip


def same(found: hybridyn.JointMap, expected: hybridyn.JointMap) -> None:
    """Compare arrays, and what they map."""
    for name in ARRAYS:
        close_to(getattr(found, name), getattr(expected, name), SOLVED)
    x, y = np.random.default_rng(0).normal(size=(2, len(expected.motors)))
    for name in ("motor_rates", "joint_rates", "joint_efforts", "motor_efforts", "at_joints", "at_motors"):
        close_to(getattr(found, name)(x), getattr(expected, name)(x), SOLVED)
    for name in ("motor_accelerations", "joint_accelerations", "joint_stiffness"):
        close_to(getattr(found, name)(x, y), getattr(expected, name)(x, y), SOLVED)
    power = np.einsum("...i,i->...", found.motor_rates(x), y) - found.joint_efforts(y) @ x
    assert np.abs(power).max() <= SOLVED * np.abs(found.motors_per_joints).max()


def agrees(compiled: hybridyn.CompiledRobot, joints: tuple[str, ...]) -> None:
    """Compare the map with that of the general path at random postures, single and batch."""
    robot = compiled.robot
    q, _, _ = moving_states(robot, 3, 1)
    same(compiled.joint_map(q, joints), hybridyn.joint_map(robot, q, joints))
    same(compiled.joint_map(q[1], joints), hybridyn.joint_map(robot, q[1], joints))
    assert compiled.recomputed == 0


def test_a_five_bar_single_and_batch() -> None:
    compiled = hybridyn.compile(hybridyn.load("five_bar"))
    agrees(compiled, ELBOWS)
    robot, first = compiled.robot, ELBOWS[0]
    for joints in ([first], [first, "nowhere"], [], [*ELBOWS, "m1_left_drive"]):
        words = error_of(compiled.joint_map, robot.home, joints)
        assert words == error_of(hybridyn.joint_map, robot, robot.home, joints)
    q, _, _ = moving_states(robot, 2, 1)
    again = pickle.loads(pickle.dumps(hybridyn.joint_map(robot, q, ELBOWS)))
    close_to(again.curvature, compiled.joint_map(q, ELBOWS).curvature, SOLVED)


@pytest.mark.slow
def test_an_ankle_from_positions_by_name(tmp_path: Path) -> None:
    compiled = hybridyn.compile(ankle(tmp_path))
    agrees(compiled, JOINTS)
    given = {"pitch": np.linspace(0.0, 0.4, 5), "roll": np.full(5, -0.2)}
    same(compiled.joint_map(given, JOINTS), hybridyn.joint_map(compiled.robot, given, JOINTS))
    assert compiled.recomputed == 0


@pytest.mark.slow
def test_other_modules_stay(tmp_path: Path) -> None:
    """The toe has no motor, the hip and the knee take no part."""
    agrees(hybridyn.compile(leg(tmp_path)), JOINTS)
