"""The node in a process of its own, over DDS on this machine alone."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.ros.joint_numbers import RosJoints
from hybridyn.structure.bodies import Payload
from tests.quantities.ankle import JOINTS, MOTORS, ankle, ankle_text, closed_form
from tests.ros.judge import open_by
from tests.support.extras import needs

needs("ros")

from builtin_interfaces.msg import Duration  # noqa: E402
from rcl_interfaces.msg import Parameter, ParameterValue  # noqa: E402
from rcl_interfaces.srv import SetParameters  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile  # noqa: E402
from std_msgs.msg import String  # noqa: E402
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint  # noqa: E402

from tests.ros.peer import NodeProcess, Peer  # noqa: E402

#: Slow, since a process of ROS may wait for another one that was killed; the warning is of ROS's own parser.
pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore:module 'sre_:DeprecationWarning")]
CLOSED = 1e-12
#: States that are sent before the first of them has come back: less than queues hold.
WINDOW = 50
#: Of the memory over 9,000 states [MB]: a leak of one array each would be some 10 MB.
GROWTH = 4.0


@pytest.fixture
def peer() -> Iterator[Peer]:
    out = Peer()
    yield out
    out.end()


@pytest.fixture
def node(tmp_path: Path, peer: Peer) -> Iterator[NodeProcess]:
    """The node of the ankle, which carries a payload that may change."""
    file = tmp_path / "ankle.urdf"
    ankle(tmp_path)
    (tmp_path / "ankle.yaml").write_text(
        f"hybridyn:\n  ros__parameters:\n    robot: {file}\n    motors: [motor_left, motor_right]\n"
        "    joints: [pitch, roll]\n    payload_link: foot\n    names: [m2=motor_right]\n"
    )
    out = NodeProcess(tmp_path, "--ros-args", "--params-file", str(tmp_path / "ankle.yaml"))
    peer.meet()
    yield out
    assert out.end() == 0


def test_all_that_the_node_answers(tmp_path: Path, node: NodeProcess, peer: Peer) -> None:
    robot = ankle(tmp_path)
    found = peer.ask(
        "motor_states",
        peer.state(1.5, ["m2", "motor_left"], [0.1, -0.05], velocity=[1.0, 2.0]),
        "joint_states",
    )
    assert (found.header.stamp.sec, found.header.stamp.nanosec) == (1, 500_000_000)
    assert open_by(robot, found.name, found.position) < CLOSED
    assert len(found.velocity) == len(found.name)
    assert not found.effort
    _, H = closed_form(*(found.position[found.name.index(name)] for name in JOINTS), np.array([-0.05, 0.1]))
    rates = [found.velocity[found.name.index(name)] for name in JOINTS]
    np.testing.assert_allclose(H @ rates, [2.0, 1.0], rtol=1e-10)

    def held(stamp: float) -> list[float]:
        """Return the efforts that hold the posture."""
        message = peer.state(stamp, ["motor_left", "m2"], [0.0, 0.0])
        return list(peer.ask("motor_states", message, "gravity_efforts").effort)

    np.testing.assert_allclose(held(2.0), hybridyn.gravity(robot, robot.home), rtol=1e-9)
    asked = peer.node.create_client(SetParameters, "/hybridyn/set_parameters")
    peer.wait(asked.service_is_ready, "the node's parameters")
    for name, value, well in (("payload_mass", 2.0, True), ("payload_mass", -1.0, False)):
        number = ParameterValue(type=3, double_value=value)
        future = asked.call_async(SetParameters.Request(parameters=[Parameter(name=name, value=number)]))
        peer.wait(future.done, "the payload is set")
        assert future.result().results[0].successful is well
    carrying = hybridyn.with_effects(robot, [Payload("foot", 2.0)])
    np.testing.assert_allclose(held(3.0), hybridyn.gravity(carrying, carrying.home), rtol=1e-9)

    wanted = peer.ask(
        "commanded_states", peer.state(0.0, JOINTS, [0.1, 0.05], velocity=[0.0, 0.0]), "feedforward"
    )
    assert tuple(wanted.name) == MOTORS
    assert np.abs(closed_form(0.1, 0.05, np.array(wanted.position))[0]).max() < 1e-13
    plan = JointTrajectory(joint_names=list(JOINTS))
    plan.points = [
        JointTrajectoryPoint(positions=[0.1 * t, 0.0], time_from_start=Duration(sec=t)) for t in (1, 2)
    ]
    motors = peer.ask("trajectory", plan, "motor_trajectory")
    back = peer.ask("trajectory", motors, "joint_trajectory")
    np.testing.assert_allclose(
        [x.positions for x in back.points], [x.positions for x in plan.points], atol=1e-10
    )
    assert [x.time_from_start.sec for x in back.points] == [1, 2]


def test_wrong_messages_give_a_line_each_and_nothing_else(node: NodeProcess, peer: Peer) -> None:
    peer.ask("motor_states", peer.state(10.0, MOTORS, [0.1, 0.1]), "joint_states")
    count = len(peer.heard["joint_states"])
    for message, said in (
        (peer.state(11.0, MOTORS, [0.1, float("nan")]), "nan is among the positions"),
        (peer.state(12.0, ["motor_left", "motor_rigth"], [0.1, 0.1]), "there is no joint 'motor_rigth'"),
        (peer.state(13.0, MOTORS, [0.1]), "1 positions of 2 joints"),
        (peer.state(14.0, MOTORS, [1e9, 0.0]), "out of reach"),
        (peer.state(1.0, MOTORS, [0.1, 0.1]), "the time of the message is before"),
    ):

        def told(said: str = said) -> bool:
            """Return whether diagnostics say it."""
            return any(said in one.status[0].message for one in peer.heard["/diagnostics"])

        peer.out["motor_states"].publish(message)
        peer.wait(told, said)
        assert len([line for line in node.log if said in line]) == 1
    assert len(peer.heard["joint_states"]) == count
    found = peer.ask("motor_states", peer.state(2.0, MOTORS, [0.1, 0.1]), "joint_states")
    np.testing.assert_array_equal([found.position[found.name.index(name)] for name in MOTORS], [0.1, 0.1])


def test_a_node_that_was_killed_and_started_again_goes_on(tmp_path: Path, peer: Peer) -> None:
    robot = hybridyn.load("five_bar")
    for t in (1, 2):
        node, heard = NodeProcess(tmp_path, "five_bar"), peer.heard["joint_states"]
        message = peer.state(t, robot.motors, [0.1 * t, 0.1])

        def answered(message: Any = message, heard: list[Any] = heard) -> bool:
            """Publish until the node is there."""
            peer.out["motor_states"].publish(message)
            return any(one.header.stamp == message.header.stamp for one in heard)

        peer.wait(answered, "an answer")
        found = heard[-1]
        assert found.header.stamp.sec == t
        assert open_by(robot, found.name, found.position) < CLOSED
        node.process.kill()
        node.process.wait()


def test_the_robot_may_come_from_a_topic(tmp_path: Path, peer: Peer) -> None:
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    describing = peer.node.create_publisher(String, "robot_description", latched)
    describing.publish(String(data=ankle_text()))
    node = NodeProcess(tmp_path, "--motors", ",".join(MOTORS))
    peer.meet()
    found = peer.ask("motor_states", peer.state(1.0, MOTORS, [0.1, 0.1]), "joint_states")
    assert open_by(ankle(tmp_path), found.name, found.position) < CLOSED
    assert node.end() == 0


@pytest.mark.slow
@pytest.mark.parametrize("name", ["five_bar", "ankle", "stewart_ur5", "lx4"])
def test_ten_thousand_states(tmp_path: Path, peer: Peer, name: str) -> None:
    """None is lost, each is closed, and memory does not grow; compiled."""
    robot = ankle(tmp_path) if name == "ankle" else hybridyn.load(name)
    words = [str(tmp_path / "ankle.urdf"), "--motors", ",".join(MOTORS)] if name == "ankle" else [name]
    node = NodeProcess(tmp_path, *words, compiled=True)
    peer.meet()
    joints, count = RosJoints(robot), 10_000
    home = joints.positions(robot.home)[[joints.names.index(motor) for motor in robot.motors]]
    for i in range(count):
        at = home + 0.01 * np.sin(0.02 * i + np.arange(len(home)))
        peer.out["motor_states"].publish(peer.state(1 + i * 0.002, robot.motors, at))
        peer.wait(lambda i=i: len(peer.heard["joint_states"]) > i - WINDOW, "what was sent")
        if i == count // 10:
            before = node.memory
    peer.wait(lambda: len(peer.heard["joint_states"]) == count, "all states")
    assert node.memory - before < GROWTH
    for found in peer.heard["joint_states"][::100]:
        assert open_by(robot, found.name, found.position) < CLOSED
    assert node.end() == 0
