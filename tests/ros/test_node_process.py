"""Processes of the node, over DDS on this machine alone: how they begin, go on and end."""

import signal
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.ros.bringup import write_bringup
from hybridyn.ros.joint_numbers import RosJoints
from tests.quantities.ankle import MOTORS, ankle, ankle_text
from tests.ros.judge import open_by
from tests.support.extras import needs

needs("ros")

from rclpy.qos import DurabilityPolicy, QoSProfile  # noqa: E402
from std_msgs.msg import String  # noqa: E402

from tests.ros.peer import Peer  # noqa: E402

#: Of ROS's own parser.
pytestmark = pytest.mark.filterwarnings("ignore:module 'sre_:DeprecationWarning")
CLOSED = 1e-12
#: States that are sent before the first of them has come back: less than queues hold.
WINDOW = 50
#: Judging a state takes longer than closing it: one of so many is judged.
JUDGED = 20
#: Of the memory over nine tenths of the states [MB]: a leak of a message each would be some 10 MB of 10,000.
GROWTH = 4.0


@pytest.fixture
def peer() -> Iterator[Peer]:
    out = Peer()
    yield out
    out.end()


@pytest.fixture
def in_namespace() -> Iterator[Peer]:
    out = Peer("left")
    yield out
    out.end()


def test_a_node_that_was_killed_and_started_again_goes_on(tmp_path: Path, peer: Peer) -> None:
    """Started as its launch file does."""
    robot = hybridyn.load("five_bar")
    write_bringup(robot, "five_bar", tmp_path)
    for t in (1, 2):
        node = peer.start(tmp_path, "--ros-args", "--params-file", str(tmp_path / "parameters.yaml"))
        found = peer.ask("motor_states", peer.state(t, robot.motors, [0.1 * t, 0.1]), "joint_states")
        assert open_by(robot, found.name, found.position) < CLOSED
        node.process.kill()
        node.process.wait()


@pytest.mark.slow
def test_robots_in_namespaces_end_as_they_are_told(tmp_path: Path) -> None:
    for name in ("stewart_ur5", "lx4"):
        (tmp_path / name).mkdir()
        peer, robot = Peer(name), hybridyn.load(name)
        try:
            node = peer.start(tmp_path / name, name, "--ros-args", "-r", f"__ns:=/{name}")
            joints = RosJoints(robot)
            home = joints.positions(robot.home)[[joints.names.index(motor) for motor in robot.motors]]
            found = peer.ask("motor_states", peer.state(1.0, robot.motors, home + 0.01), "joint_states")
            assert open_by(robot, found.name, found.position) < CLOSED
            assert node.end(signal.SIGTERM) == 0
            assert not any("Error" in line for line in node.log)
        finally:
            peer.end()


@pytest.mark.slow
def test_a_rate_bounds_the_states_that_go_out(tmp_path: Path, peer: Peer) -> None:
    node = peer.start(tmp_path, "five_bar", "--rate", "0.0001")  # one in hours
    motors, told = hybridyn.load("five_bar").motors, peer.heard["/diagnostics"]
    peer.ask("motor_states", peer.state(1.0, motors, [0.1, 0.1]), "joint_states")
    for t in (2.0, 3.0, 4.0):
        peer.out["motor_states"].publish(peer.state(t, motors, [0.1, 0.1]))
    count = len(told)
    peer.wait(lambda: len(told) > count + 1, "diagnostics, which come after")
    assert {one.key: one.value for one in told[-1].status[0].values}["states completed"] == "1"
    assert {one.header.stamp.sec for one in peer.heard["joint_states"]} == {1}
    assert node.end() == 0


def test_the_robot_may_come_from_a_topic(tmp_path: Path, in_namespace: Peer) -> None:
    """In a namespace, where it ends as it is told."""
    peer, latched = in_namespace, QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    describing = peer.node.create_publisher(String, "robot_description", latched)
    describing.publish(String(data=ankle_text()))
    node = peer.start(tmp_path, "--motors", ",".join(MOTORS), "--ros-args", "-r", "__ns:=/left")
    found = peer.ask("motor_states", peer.state(1.0, MOTORS, [0.1, 0.1]), "joint_states")
    assert open_by(ankle(tmp_path), found.name, found.position) < CLOSED
    assert node.end(signal.SIGTERM) == 0
    assert not any("Error" in line for line in node.log)


WRONG = {
    "a word of ROS": (["-q"], "ROS 2 does not start: ['-q']"),
    "a file": (["--params-file", "none.yaml"], "none.yaml"),
    "a kind": (["-p", "motors:=both"], "it is a list of names, as in [a, b]"),
    "a rate": (["-p", "rate:=-1"], "'rate' is -1.0"),
    "a joint": (["-p", "names:=[m1=elbow]"], "there is no joint 'elbow'"),
    "itself": (["-r", "motor_states:=joint_states"], "the node would hear itself"),
}


@pytest.mark.slow
@pytest.mark.parametrize(("words", "said"), WRONG.values(), ids=WRONG)
def test_a_wrong_start_is_one_line(tmp_path: Path, peer: Peer, words: list[str], said: str) -> None:
    node = peer.start(tmp_path, "five_bar", "--ros-args", *words)
    assert node.process.wait(300) == 1
    assert node.log[-1].startswith("error: ")
    assert said in node.log[-1]
    assert not any("Traceback" in line for line in node.log)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "count"),
    [("five_bar", 100_000), ("ankle", 10_000), ("stewart_ur5", 10_000), ("lx4", 10_000)],
)
def test_thousands_of_states(tmp_path: Path, peer: Peer, name: str, count: int) -> None:
    """None is lost, each that is judged is closed, and memory does not grow; compiled."""
    robot = ankle(tmp_path) if name == "ankle" else hybridyn.load(name)
    words = [str(tmp_path / "ankle.urdf"), "--motors", ",".join(MOTORS)] if name == "ankle" else [name]
    node = peer.start(tmp_path, *words, compiled=True)
    joints, heard = RosJoints(robot), set[int]()
    home = joints.positions(robot.home)[[joints.names.index(motor) for motor in robot.motors]]
    peer.ask("motor_states", peer.state(0.5, robot.motors, home), "joint_states")

    def hear() -> int:
        """Take what has come, and return how much has."""
        for found in (found for found in peer.heard["joint_states"] if found.header.stamp.sec):
            if len(heard) % JUDGED == 0:
                assert open_by(robot, found.name, found.position) < CLOSED
            heard.add(found.header.stamp.sec * 500 + found.header.stamp.nanosec // 2_000_000)
        peer.heard["joint_states"].clear()
        return len(heard)

    before = 0.0
    for i in range(count):
        at = home + 0.01 * np.sin(0.02 * i + np.arange(len(home)))
        peer.out["motor_states"].publish(peer.state(1 + i * 0.002, robot.motors, at))
        peer.wait(lambda i=i: hear() > i - WINDOW, "what was sent")
        if i == count // 10:
            before = node.memory
    peer.wait(lambda: hear() == count, "all states")
    assert node.memory - before < GROWTH
    assert node.end() == 0
