"""Rounding is not held against itself: in free fall, at rest and in a locked module all terms cancel."""

from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.spatial import Array, rotation_from_quaternion
from tests.support.comparing import close_to, refused
from tests.support.files import save

FALLING = ("lx4", "delta", "snake")
NOISE = 1e-17
SMALL = 1e-11  # of weight times size: what is left of efforts that cancel


def askew(robot: hybridyn.HybridRobot, rng: np.random.Generator) -> Array:
    """Return the home posture with the base somewhere, turned at will."""
    q = robot.home.copy()
    q[:3], q[3:7] = rng.normal(size=3), rng.normal(size=4)
    q[3:7] /= np.linalg.norm(q[3:7])
    return q


def heavy(robot: hybridyn.HybridRobot) -> float:
    return 9.81 * sum(body.mass for body in robot.bodies.bodies) * robot.bodies.size


@pytest.mark.parametrize("name", FALLING)
def test_a_robot_in_free_fall_needs_no_effort(name: str) -> None:
    """At rest, coasting, and with the fall found from the motors, the base turned at random."""
    robot, rng = hybridyn.load(name, base="floating"), np.random.default_rng(7)
    for _ in range(3):
        q, v, a = askew(robot, rng), np.zeros(robot.nv), np.zeros(robot.nv)
        a[:3] = rotation_from_quaternion(q[None, 3:7])[0].T @ robot.gravity
        coasting = v.copy()
        coasting[:3] = rng.normal(size=3)
        for rates, given in ((v, "given"), (coasting, "given"), (v, "solved"), (coasting, "solved")):
            tau = hybridyn.idm(robot, q, rates, a, passive=given)
            assert np.abs(tau).max() < SMALL * heavy(robot)


@pytest.mark.parametrize("name", FALLING)
def test_a_base_that_does_not_fall_is_still_refused(name: str) -> None:
    """Nothing holds it: a millionth of the weight is an effort, no rounding."""
    robot, rng = hybridyn.load(name, base="floating"), np.random.default_rng(7)
    q, v, a = askew(robot, rng), np.zeros(robot.nv), np.zeros(robot.nv)
    a[:3] = (1 - 1e-6) * (rotation_from_quaternion(q[None, 3:7])[0].T @ robot.gravity)
    refused(lambda: hybridyn.idm(robot, q, v, a), hybridyn.ActuationError, "no motor can produce")


@pytest.mark.parametrize("gravity", [(0.0, 0.0, -9.81), (0.0, 0.0, 0.0)])
@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_rates_and_accelerations_of_rounding_are_rest(base: str, gravity: tuple[float, float, float]) -> None:
    robot = hybridyn.load("delta", base=base, gravity=gravity)  # type: ignore[arg-type]
    rng = np.random.default_rng(1)
    still = np.zeros(robot.nv)
    noise, more = NOISE * rng.normal(size=(2, robot.nv))
    tau = hybridyn.idm(robot, robot.home, still, still, passive="solved")
    again = hybridyn.idm(robot, robot.home, noise, more, passive="solved")
    assert np.abs(again - tau).max() < 1e-14 * heavy(hybridyn.load("delta"))
    a = hybridyn.ddm(robot, robot.home, still, tau)
    assert np.abs(hybridyn.ddm(robot, robot.home, noise, tau) - a).max() < 1e-12
    if base == "fixed":
        hybridyn.idm(robot, robot.home, noise, more)
    refused(
        lambda: hybridyn.ddm(robot, robot.home, 1e8 * noise, tau),
        hybridyn.AssemblyError,
        "the rates do not close",
    )


LOCKED = """<robot name="locked"><link name="ground"/>
  <link name="left">{mass}</link><link name="right">{mass}</link><link name="arm">{mass}</link>
  <joint name="a" type="revolute"><parent link="ground"/><child link="left"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="9" velocity="9"/></joint>
  <joint name="b" type="revolute"><origin xyz="1 0 0"/><parent link="ground"/><child link="right"/>
    <axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="9" velocity="9"/></joint>
  <joint name="drive" type="revolute"><origin xyz="0.5 0 1"/><parent link="left"/><child link="arm"/>
    <axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="9" velocity="9"/></joint>
  <loop name="top" type="rows" rows="tx tz"><predecessor link="left"><origin xyz="0.5 0 1"/></predecessor>
    <successor link="right"><origin xyz="-0.5 0 1"/></successor></loop>
  <transmission name="t"><type>transmission_interface/SimpleTransmission</type><joint name="drive"/>
    <actuator name="m"/></transmission>
</robot>"""
MASS = (
    '<inertial><origin xyz="0.1 0 0.2"/><mass value="2"/>'
    '<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.25"/></inertial>'
)


def test_a_locked_module_may_carry_rounding(tmp_path: Path) -> None:
    """A truss of two bars cannot move; its rates of 1e-17 are no motion, 1e-6 are."""
    path = save(tmp_path, LOCKED.format(mass=MASS), "locked.urdf")
    robot = hybridyn.load(path)
    assert robot.mobility == 1
    q, v = robot.home, np.zeros(robot.nv)
    v[robot.joint_index["drive"]] = 1.0
    noisy = v + NOISE * np.array([1.0, -2.0, 3.0])
    close_to(hybridyn.ddm(robot, q, noisy, np.ones(1)), hybridyn.ddm(robot, q, v, np.ones(1)), 1e-14)
    close_to(hybridyn.idm(robot, q, noisy, noisy), hybridyn.idm(robot, q, v, v), 1e-14)
    refused(
        lambda: hybridyn.ddm(robot, q, v + 1e-6 * np.array([1.0, 0.0, 0.0]), np.ones(1)),
        hybridyn.AssemblyError,
        "the rates do not close",
    )


@pytest.mark.parametrize("length", [0.0, 2.0, 1.001])
@pytest.mark.parametrize("base", ["moving", "floating"])
def test_a_quaternion_has_length_one(base: str, length: float) -> None:
    """Of length zero it gave NaN, of length two another posture."""
    robot = hybridyn.load("delta", base=base)  # type: ignore[arg-type]
    q, v, tau = robot.home.copy(), np.zeros(robot.nv), np.zeros(len(robot.motors))
    q[3:7] *= length
    calls = (
        lambda: hybridyn.idm(robot, q, v, v),
        lambda: hybridyn.ddm(robot, np.stack([robot.home, q]), np.stack([v, v]), np.stack([tau, tau])),
        lambda: hybridyn.kinematics(robot, q, v),
        lambda: hybridyn.closure_residual(robot, q),
        lambda: hybridyn.centre_of_mass(robot, q),
    )
    for call in calls:
        refused(call, hybridyn.TrajectoryError, rf"quaternion of joint 'root_joint'.* length {length:g}")
    if base == "floating":
        refused(
            lambda: hybridyn.simulate(robot, q, v, [0.0, 0.1]),
            hybridyn.TrajectoryError,
            rf"q0: the quaternion.* length {length:g}",
        )


def test_cosine_and_sine_have_length_one_together(tmp_path: Path) -> None:
    path = save(
        tmp_path,
        f'<robot name="one"><link name="a"/><link name="b">{MASS}</link><joint name="turn" type="continuous">'
        '<parent link="a"/><child link="b"/><axis xyz="0 1 0"/></joint></robot>',
        "one.urdf",
    )
    robot = hybridyn.load(path)
    refused(
        lambda: hybridyn.ddm(robot, np.array([2.0, 0.0]), np.zeros(1), np.zeros(len(robot.motors))),
        hybridyn.TrajectoryError,
        "cosine and sine of joint 'turn' at sample 0 has length 2",
    )
