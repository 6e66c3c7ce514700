"""What the node answers, over DDS on this machine alone: one process of the node of an ankle."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.structure.bodies import Payload
from tests.quantities.ankle import JOINTS, MOTORS, ankle, closed_form
from tests.ros.judge import open_by
from tests.support.extras import needs

needs("ros")

from builtin_interfaces.msg import Duration  # noqa: E402
from rcl_interfaces.msg import Parameter, ParameterValue, SetParametersResult  # noqa: E402
from rcl_interfaces.srv import SetParameters  # noqa: E402
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint  # noqa: E402

from tests.ros.peer import NodeProcess, Peer  # noqa: E402

#: Of ROS's own parser.
pytestmark = pytest.mark.filterwarnings("ignore:module 'sre_:DeprecationWarning")
CLOSED = 1e-12
#: Messages that are wrong in the same way: a line each second is said of them, which take far less each.
MANY = 100
#: As the driver calls the motors.
DRIVEN = ("m1", "m2")


@pytest.fixture(scope="module")
def peer() -> Iterator[Peer]:
    out = Peer()
    yield out
    out.end()


@pytest.fixture(scope="module")
def node(tmp_path_factory: pytest.TempPathFactory, peer: Peer) -> Iterator[NodeProcess]:
    """The node of the ankle, which carries a payload that may change."""
    folder = tmp_path_factory.mktemp("node")
    ankle(folder)
    (folder / "ankle.yaml").write_text(
        f"hybridyn:\n  ros__parameters:\n    robot: {folder}/ankle.urdf\n"
        f"    motors: [motor_left, motor_right]\n    joints: [pitch, roll]\n    payload_link: foot\n"
        "    names: [m1=motor_left, m2=motor_right]\n    trajectory_efforts: true\n    motor: none\n"
        "    payload_centre: [0, 0, 0]\n    rate: 100000\n"
    )
    out = peer.start(folder, "--ros-args", "--params-file", str(folder / "ankle.yaml"))
    yield out
    assert out.end() == 0


def test_states_are_complete(tmp_path: Path, node: NodeProcess, peer: Peer) -> None:
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
    assert [line for line in node.log if "WARN" in line and "did you mean 'motors'" in line]


def test_efforts_carry_a_payload_that_is_set(tmp_path: Path, node: NodeProcess, peer: Peer) -> None:
    robot = ankle(tmp_path)

    def held(stamp: float) -> list[float]:
        """Return the efforts that hold the posture."""
        message = peer.state(stamp, DRIVEN, [0.0, 0.0])
        found = peer.ask("motor_states", message, "gravity_efforts")
        assert tuple(found.name) == DRIVEN
        return list(found.effort)

    def change(name: str, value: ParameterValue) -> SetParametersResult:
        """Set a parameter, and return what the node says."""
        asked, request = [], SetParameters.Request(parameters=[Parameter(name=name, value=value)])
        client = peer.node.create_client(SetParameters, "/hybridyn/set_parameters")
        peer.ask_until(
            lambda: asked.append(client.call_async(request)),
            lambda: any(one.done() for one in asked),
            "the node's answer to new parameters",
        )
        return next(one for one in asked if one.done()).result().results[0]

    np.testing.assert_allclose(held(2.0), hybridyn.gravity(robot, robot.home), rtol=1e-9)
    assert change("payload_mass", ParameterValue(type=2, integer_value=2)).successful
    assert "negative" in change("payload_mass", ParameterValue(type=3, double_value=-1.0)).reason
    assert "a number" in change("payload_mass", ParameterValue(type=4, string_value="2 kg")).reason
    carrying = hybridyn.with_effects(robot, [Payload("foot", 2.0)])
    np.testing.assert_allclose(held(3.0), hybridyn.gravity(carrying, carrying.home), rtol=1e-9)
    wanted = peer.ask(
        "commanded_states", peer.state(0.0, JOINTS, [0.1, 0.05], velocity=[0.0, 0.0]), "feedforward"
    )
    assert tuple(wanted.name) == DRIVEN
    assert np.abs(closed_form(0.1, 0.05, np.array(wanted.position))[0]).max() < 1e-13
    assert change("payload_mass", ParameterValue(type=3, double_value=0.0)).successful


def test_trajectories_go_to_the_driver_and_back(node: NodeProcess, peer: Peer) -> None:
    plan = JointTrajectory(joint_names=list(JOINTS))
    plan.header.stamp.sec = 7
    plan.points = [
        JointTrajectoryPoint(
            positions=[0.1 * t, 0.0], velocities=[0.1, 0.0], accelerations=[0.0, 0.0],
            time_from_start=Duration(sec=t),
        )
        for t in (1, 2)
    ]  # fmt: skip
    motors = peer.ask("trajectory", plan, "motor_trajectory")
    assert tuple(motors.joint_names) == DRIVEN
    assert [len(x.effort) for x in motors.points] == [2, 2]
    back = peer.ask("trajectory", motors, "joint_trajectory")
    np.testing.assert_allclose(
        [x.positions for x in back.points], [x.positions for x in plan.points], atol=1e-10
    )
    assert [x.time_from_start.sec for x in back.points] == [1, 2]
    assert back.header == plan.header


def test_wrong_messages_give_a_line_each_and_nothing_else(node: NodeProcess, peer: Peer) -> None:
    peer.ask("motor_states", peer.state(10.0, MOTORS, [0.1, 0.1]), "joint_states")
    peer.wait(lambda: bool(peer.heard["/diagnostics"]), "diagnostics")
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
    for i in range(MANY):  # each with numbers of its own in its line
        peer.out["motor_states"].publish(peer.state(1.0, MOTORS, [1e9 + i, 0.0]))
    assert {one.header.stamp.sec for one in peer.heard["joint_states"]} == {10}
    found = peer.ask("motor_states", peer.state(2.0, MOTORS, [0.1, 0.1]), "joint_states")
    np.testing.assert_array_equal([found.position[found.name.index(name)] for name in MOTORS], [0.1, 0.1])
    assert len([line for line in node.log if "out of reach" in line]) < MANY / 2
