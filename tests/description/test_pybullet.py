"""Forms of URDF and SDF whose meaning is PyBullet's, where it is installed (`pip install pybullet`).

Its own dynamics is no judge of SDF: `loadSDF` takes inertia from shapes, and its models of forces know
neither the turn of a base nor balls. Places of links and masses are compared; for its own URDF files also
inverse dynamics.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from tests.description.reading import refused
from tests.description.sdf_texts import joint, link, sdf
from tests.robots.robot_texts import INERTIAL
from tests.support.files import save

bullet = pytest.importorskip("pybullet", reason="pip install pybullet")
bullet_data = pytest.importorskip("pybullet_data", reason="pip install pybullet")

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


#: Robots that PyBullet ships, as they are read: all that have joints, but those below.
SHIPPED = sorted(
    path for path in Path(bullet_data.getDataPath()).rglob("*.urdf") if "random_urdfs" not in path.parts
)
#: Files that are refused, and what is told.
REFUSED = {
    "bike.urdf": "xyz '0.07,' is not a finite number",
    "biped2d_pybullet.urdf": "lower '-1.57.' is not a finite number",
    "humanoid.urdf": "Extra content at the end of the document",
    "husky.urdf": "attribute 'xyz' has 5 numbers instead of 3",
    "microtaur.urdf": "attribute 'rpy' has 4 numbers instead of 3",
    "spirit40newer.urdf": "<axis>: stated twice",
    "torus_deform.urdf": "the robot has no link",
}
#: Files that PyBullet itself does not load, or moves otherwise than Pinocchio, which reads them as we do: it
#: sets inertia to zero that violates the triangle inequality, and it misplaces a wheel.
OTHERWISE = {
    "model_for_sdf.urdf", "concave_box.urdf", "mini_cheetah.urdf", "xarm6_robot.urdf",
    "xarm6_robot_white.urdf", "racecar_differential.urdf", "TwoJointRobot_w_fixedJoints.urdf",
    "TwoJointRobot_wo_fixedJoints.urdf",
}  # fmt: skip
KINDS = {bullet.JOINT_REVOLUTE: ("revolute", "continuous"), bullet.JOINT_PRISMATIC: ("prismatic",),
         bullet.JOINT_SPHERICAL: ("spherical",), bullet.JOINT_FIXED: ("fixed",)}  # fmt: skip
#: PyBullet finds principal axes of inertia to 1e-5, by its own iteration.
AGAINST_EFFORTS = 1e-5


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.name)
def test_the_robots_of_pybullet_have_its_joints_masses_and_efforts(server: Any, path: Path) -> None:
    if path.name in REFUSED:
        refused(path, REFUSED[path.name])
        return
    robot = hybridyn.load(path)
    if path.name in OTHERWISE:
        theirs = pin.buildModelFromUrdf(str(path))
        assert theirs.njoints == robot.model.njoints
        return
    flags = bullet.URDF_USE_INERTIA_FROM_FILE | bullet.URDF_MAINTAIN_LINK_ORDER
    body = server.loadURDF(str(path), useFixedBase=True, flags=flags)
    joints = {one.name: one for one in robot.description.joints}
    links = {one.name: one for one in robot.description.links}
    moving = list[str]()
    for number in range(server.getNumJoints(body)):
        info = server.getJointInfo(body, number)
        name, link = info[1].decode(), info[12].decode()
        assert joints[name].kind in KINDS[info[2]]
        assert server.getDynamicsInfo(body, number)[0] == pytest.approx(links[link].mass, rel=1e-12)
        moving += [name] * (joints[name].kind != "fixed")
    if moving and all(joints[name].kind.single for name in moving) and not robot.description.couplings:
        efforts(server, body, robot, moving)


def efforts(server: Any, body: int, robot: hybridyn.HybridRobot, moving: list[str]) -> None:
    """Compare inverse dynamics of a tree on a fixed base at a drawn state."""
    server.setGravity(0, 0, -9.81)
    state = np.random.default_rng(0).uniform(-0.5, 0.5, (3, len(moving)))
    theirs = server.calculateInverseDynamics(body, *map(list, state))
    q, v, a = pin.neutral(robot.model), np.zeros(robot.nv), np.zeros(robot.nv)
    order = [robot.joints.index(name) for name in moving]
    for number, x in zip(order, state.T, strict=True):
        at = robot.q_slices[number]
        q[at] = (np.cos(x[0]), np.sin(x[0])) if at.stop - at.start == 2 else x[0]
        v[robot.v_slices[number]], a[robot.v_slices[number]] = x[1], x[2]
    found = pin.rnea(robot.model, robot.model.createData(), q, v, a)
    ours = [found[robot.v_slices[number]][0] for number in order]
    np.testing.assert_allclose(ours, theirs, atol=AGAINST_EFFORTS * np.abs(theirs).max())
