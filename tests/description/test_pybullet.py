"""Forms of URDF and SDF whose meaning is PyBullet's, where it is installed (`pip install pybullet`).

Its own dynamics is no judge: `loadSDF` takes inertia from shapes, and its models of forces know neither the
turn of a base nor balls. Places of links and masses are compared.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from tests.files import save
from tests.robot_texts import INERTIAL
from tests.sdf_texts import joint, link, sdf

bullet = pytest.importorskip("pybullet", reason="pip install pybullet")

#: PyBullet tells places of links in single precision.
AGAINST_BULLET = 5e-7

LIMITS = (
    "<limit><lower>-3</lower><upper>3</upper><effort>9</effort><velocity>9</velocity></limit>"
    "<dynamics><damping>0</damping><friction>0</friction></dynamics>"
)
GRIPPER = sdf(
    "<pose>0 0 0.7 2.5 0.2 0</pose>", '<link name="world"/>', link("base", "<pose>0.1 0 0.2 0 0.3 0</pose>"),
    link("arm", "<pose>0.4 0 0.2 0 0 0.5</pose>"),
    joint("rail", "prismatic", "world", "base", axis="0 0 1").replace("</xyz>", f"</xyz>{LIMITS}"),
    joint("j", "revolute", "base", "arm", axis="0 1 0").replace("</xyz>", f"</xyz>{LIMITS}"), version="1.6",
)  # fmt: skip
BALL = (
    f'<robot name="r"><link name="base">{INERTIAL}</link><link name="arm">{INERTIAL}</link><link name="tip">'
    f'{INERTIAL}</link><joint name="b" type="spherical"><origin xyz="0.1 0.2 0.3" rpy="0.3 0.2 0.1"/>'
    '<parent link="base"/><child link="arm"/></joint><joint name="h" type="revolute"><origin xyz="0.4 0 0"/>'
    '<parent link="arm"/><child link="tip"/><axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="9" '
    'velocity="9"/></joint></robot>'
)


@pytest.fixture
def server() -> Any:
    """Connect to PyBullet without a window, and end it."""
    bullet.connect(bullet.DIRECT)
    yield bullet
    bullet.disconnect()


def compare(server: Any, body: int, robot: hybridyn.HybridRobot, q: np.ndarray) -> None:
    """Compare the centres of mass and the axes of all links that joints move, and their masses."""
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    known = {one.name: one for one in robot.description.links}
    for number in range(server.getNumJoints(body)):
        name = server.getJointInfo(body, number)[12].decode()
        at = data.oMf[robot.model.getFrameId(name, pin.BODY)]
        place, _, _, _, _, turn = server.getLinkState(body, number, computeForwardKinematics=True)[:6]
        np.testing.assert_allclose(at.act(known[name].com), place, atol=AGAINST_BULLET)
        axes = np.reshape(server.getMatrixFromQuaternion(turn), (3, 3))
        np.testing.assert_allclose(at.rotation, axes, atol=AGAINST_BULLET)
        assert server.getDynamicsInfo(body, number)[0] == known[name].mass


def test_a_link_called_world_stands_still_where_its_model_is(server: Any, tmp_path: Path) -> None:
    world = GRIPPER.replace("<model", '<world name="w"><model').replace("</model>", "</model></world>")
    file = save(tmp_path, world, "r.sdf")
    (body,) = server.loadSDF(str(file))
    assert server.getBodyInfo(body)[0] == b"world"
    assert server.getDynamicsInfo(body, -1)[0] == 0.0
    robot, q = hybridyn.load(file), np.array([0.3, -0.4])
    assert (robot.base, robot.joints) == ("fixed", ("rail", "j"))
    for number, x in enumerate(q):
        server.resetJointState(body, number, x)
    compare(server, body, robot, q)


def test_a_spherical_joint_turns_by_the_quaternion_of_the_child(server: Any, tmp_path: Path) -> None:
    file = save(tmp_path, BALL)
    body = server.loadURDF(str(file), useFixedBase=True)
    robot = hybridyn.load(file)
    quat = np.array([0.1, 0.2, -0.3, 0.9])
    quat /= np.linalg.norm(quat)
    server.resetJointStateMultiDof(body, 0, quat.tolist())
    server.resetJointState(body, 1, 0.4)
    (base,) = (one for one in robot.description.links if one.name == "base")
    # PyBullet places the base by its centre of mass.
    server.resetBasePositionAndOrientation(body, base.com.tolist(), [0, 0, 0, 1])
    compare(server, body, robot, np.array([*quat, 0.4]))
