"""joint_map: a parallel ankle against closed form, the leg that holds it, and power."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn import HybridRobot
from hybridyn.assembly.posture import holding
from hybridyn.dynamics.quantities import regular_map
from hybridyn.dynamics.quantities.joint_map import JointMap
from hybridyn.errors import SingularityError, TrajectoryError
from tests.dynamics.test_idm import flat_five_bar
from tests.quantities.ankle import JOINTS, MOTORS, ankle, closed_form, leg
from tests.robots.mechanisms import random_mechanism, random_states
from tests.support.comparing import ROUNDING, SOLVED, close_to, refused

#: Angles at which the map is judged [rad].
PITCH, ROLL = np.array([0.0, 0.2, -0.3]), np.array([0.0, -0.15, 0.1])
#: Of second derivatives, by differences of the fourth order over `STEP`.
STEP, DIFFERENCE = 1e-3, 1e-9


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> HybridRobot:
    """The ankle."""
    return ankle(tmp_path_factory.mktemp("ankle"))


def test_the_ankle_against_closed_form(robot: HybridRobot) -> None:
    found = hybridyn.joint_map(robot, {"pitch": PITCH, "roll": ROLL}, JOINTS)
    assert (found.joints, found.motors) == (JOINTS, MOTORS)
    close_to(found.joint_positions, np.stack([PITCH, ROLL], axis=1), SOLVED)
    for t in range(3):
        miss, H = closed_form(PITCH[t], ROLL[t], found.motor_positions[t])
        assert np.abs(miss).max() < ROUNDING
        close_to(found.motors_per_joints[t], H, SOLVED)
        close_to(found.joints_per_motors[t], np.linalg.inv(H), SOLVED)


def test_from_the_motors_back_to_the_joints(robot: HybridRobot) -> None:
    there = hybridyn.joint_map(robot, {"pitch": PITCH, "roll": ROLL}, JOINTS)
    back = hybridyn.joint_map(robot, dict(zip(MOTORS, there.motor_positions.T, strict=True)), JOINTS)
    close_to(back.joint_positions, there.joint_positions, SOLVED)
    rates = np.random.default_rng(0).normal(size=(3, 2))
    close_to(there.joint_rates(there.motor_rates(rates)), rates, SOLVED)
    close_to(there.motor_efforts(there.joint_efforts(rates)), rates, SOLVED)


def test_reflected_inertia_is_that_of_the_mass_matrix(robot: HybridRobot) -> None:
    """Rotors on the motors add to the mass matrix over pitch and roll what the map says."""
    found = hybridyn.joint_map(robot, {"pitch": 0.1, "roll": -0.2}, JOINTS)
    rotors = hybridyn.effects.RotorInertia(dict(zip(MOTORS, (0.01, 0.02), strict=True)))
    bare = hybridyn.mass_matrix(robot, found.q, joints=JOINTS)
    both = hybridyn.mass_matrix(robot, found.q, joints=JOINTS, effects=["default", rotors])
    close_to(both - bare, found.at_joints([0.01, 0.02]), SOLVED)
    close_to(
        found.at_motors([0.3, 0.1]),
        found.joints_per_motors.T @ np.diag([0.3, 0.1]) @ found.joints_per_motors,
        SOLVED,
    )
    tau = hybridyn.gravity(robot, found.q)
    close_to(hybridyn.gravity(robot, found.q, joints=JOINTS), found.joint_efforts(tau), SOLVED)


def test_stiffness_under_load_by_differences(robot: HybridRobot) -> None:
    """Motors hold like springs that carry efforts: the joints' efforts change as the stiffness says."""
    stiffness, carried, centre = np.array([300.0, 200.0]), np.array([20.0, -35.0]), np.array([0.1, -0.2])
    here = hybridyn.joint_map(robot, dict(zip(JOINTS, centre, strict=True)), JOINTS)
    K = np.zeros((2, 2))
    for i in range(2):
        values = []
        for step in (-2, -1, 1, 2):
            at = centre + step * STEP * np.eye(2)[i]
            near = hybridyn.joint_map(robot, dict(zip(JOINTS, at, strict=True)), JOINTS)
            held = carried + stiffness * (near.motor_positions - here.motor_positions)
            values.append(near.joint_efforts(held))
        K[:, i] = (values[0] - 8 * values[1] + 8 * values[2] - values[3]) / (12 * STEP)
    close_to(here.joint_stiffness(stiffness, carried), K, DIFFERENCE)


def test_accelerations_both_ways(robot: HybridRobot) -> None:
    motion = {"pitch": (0.1, 1.5, -2.0), "roll": (-0.2, -0.7, 3.0)}
    q, v, a = hybridyn.assemble(holding(robot, JOINTS), motors=motion)
    columns = [robot.v_slices[robot.joint_index[m]].start for m in MOTORS]
    found = hybridyn.joint_map(robot, q, JOINTS)
    rates, accelerations = np.array(list(motion.values()))[:, 1:].T
    close_to(found.motor_rates(rates), v[columns], SOLVED)
    close_to(found.motor_accelerations(rates, accelerations), a[columns], SOLVED)
    close_to(found.joint_accelerations(v[columns], a[columns]), accelerations, SOLVED)


def test_the_ankle_of_a_leg_is_the_ankle(robot: HybridRobot, tmp_path: Path) -> None:
    """Hip, knee and a toe without a motor take no part in the map."""
    alone, whole = hybridyn.joint_map(robot, {"pitch": 0.2, "roll": 0.1}, JOINTS), leg(tmp_path)
    found = hybridyn.joint_map(whole, alone_in(whole, alone), JOINTS)
    close_to(found.motors_per_joints, alone.motors_per_joints, SOLVED)
    close_to(found.motor_positions, alone.motor_positions, SOLVED)


def alone_in(robot: hybridyn.HybridRobot, alone: object) -> np.ndarray:
    """Return a posture of the leg with the ankle as it is alone, and its other joints bent."""
    q = np.array([0.3, *np.zeros(robot.nq - 1)])
    for name, at in zip(alone.robot.joints, alone.robot.q_slices, strict=True):
        q[robot.q_slices[robot.joint_index[name]]] = alone.q[at]
    return q


def test_a_serial_joint_is_its_own_motor() -> None:
    robot = hybridyn.load("stewart_ur5")
    motor = robot.motors[-1]
    found = hybridyn.joint_map(robot, robot.home, [motor])
    assert found.motors == (motor,)
    np.testing.assert_array_equal(found.motors_per_joints, [[1.0]])
    assert not found.curvature.any()


def test_bad_questions_are_refused(robot: HybridRobot) -> None:
    description = random_mechanism(0, kind="four_bar_two_motors")
    redundant = hybridyn.structure.building.build_robot(description)
    q, _, _ = random_states(description, "fixed", 0, 1)
    for call, error, words in (
        (
            lambda: hybridyn.joint_map(robot, robot.home, ["pitch"]),
            SingularityError,
            r"1 chosen joints for 2 freedoms leave the motion of",
        ),
        (
            lambda: hybridyn.joint_map(robot, robot.home, ["pich", "roll"]),
            TrajectoryError,
            r"unknown joint 'pich' \(did you mean 'pitch'\?\)",
        ),
        (lambda: hybridyn.joint_map(robot, robot.home, []), TrajectoryError, r"name the output joints"),
        (
            lambda: hybridyn.joint_map(redundant, q, [redundant.joints[-1]]),
            SingularityError,
            r"2 motors for 1 freedom cannot .*with motors=\[...\], 1 in this",
        ),
    ):
        refused(call, error, words)


def test_singular_samples_are_left_out_without_quadratic_work(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every second posture is singular: the rows computed in all are T log T, not T^2 / 4."""
    robot, flat = flat_five_bar()
    q = np.tile(flat, (64, 1))
    q[1::2] = robot.home
    assert np.abs(flat - robot.home).max() > 0.1
    rows = []

    def counted(of: HybridRobot, some: np.ndarray, names: Sequence[str]) -> JointMap:
        rows.append(len(some))
        return hybridyn.joint_map(of, some, names)

    monkeypatch.setattr(regular_map, "joint_map", counted)
    found, kept = regular_map.regular_map(robot, q, robot.motors)
    assert found is not None
    assert kept == list(range(1, 64, 2))
    close_to(found.motors_per_joints, np.tile(np.eye(2), (32, 1, 1)), ROUNDING)
    assert sum(rows) <= 64 * 7  # 64 log2(64), and once more for the result
    assert regular_map.regular_map(robot, q[::2], robot.motors) == (None, [])
