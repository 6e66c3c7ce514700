"""The node: it connects the model to topics. Wrong messages are refused, and the node goes on.

in     motor_states       sensor_msgs/JointState               measured: of the motors, or of other joints
       commanded_states   sensor_msgs/JointState               wanted: efforts are asked for
       trajectory         trajectory_msgs/JointTrajectory      of output joints, or of motors
       robot_description  std_msgs/String                      where no file of the robot is named
out    joint_states       sensor_msgs/JointState               all joints, at the time that was measured
       gravity_efforts    sensor_msgs/JointState               of the motors: what holds the measured posture
       feedforward        sensor_msgs/JointState               of the motors: what the commanded state needs
       motor_trajectory   trajectory_msgs/JointTrajectory      from one of output joints
       joint_trajectory   trajectory_msgs/JointTrajectory      from one of motors
       /diagnostics       diagnostic_msgs/DiagnosticArray      each second, and when a message is refused
"""

from __future__ import annotations

import re
import tempfile
import time
from array import array
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from builtin_interfaces.msg import Duration
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from ..errors import HybridynError, ModelError
from ..spatial import Array
from ..structure.robot import HybridRobot
from .complete_states import CompleteStates
from .health import Health
from .joint_numbers import JointNumbers, check_names
from .ros_model import RosModel
from .settings import CHANGEABLE, RosSettings, checked, declared
from .turned_trajectories import JointPoint, turned

#: Loads a robot from a file, with motors other than those of the file if any are named.
Load = Callable[[str, Sequence[str]], HybridRobot]
#: As sensors publish, so that any publisher is heard; two seconds at 500 Hz wait meanwhile.
SENSOR = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)
#: As plans are published, once: none is lost.
PLAN = QoSProfile(depth=100)
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
#: Messages that wait for a slow subscriber.
WAITING = 100
#: Time after which a line like one before is said again [s], and between diagnostics [s].
AGAIN = 1.0
#: Processor time [s] of a refusal that is long: ten states wait after it at 500 Hz.
LONG = 0.02
NUMBER = re.compile(r"\d[\d.e+-]*")
#: Different lines that are said in this time.
LINES = 10
SECOND = 1_000_000_000


def run(load: Load, settings: RosSettings, ros_args: Sequence[str]) -> None:
    """Run the node until it is interrupted.

    Args:
        load: Loads the robot.
        settings: The parameters that ROS does not give.
        ros_args: Arguments of ROS, from "--ros-args" on.

    Raises:
        HybridynError: The robot or a parameter is wrong.
    """
    try:
        rclpy.init(args=list(ros_args))
        node = rclpy.create_node("hybridyn")
    except RuntimeError as error:  # all that rclpy raises of arguments, names and the middleware
        raise ModelError(f"ROS 2 does not start: {str(error).partition(', at /')[0]}") from error
    executor = SingleThreadedExecutor()
    try:
        executor.add_node(RosNode(node, load, settings).node)
        executor.spin()
    except (KeyboardInterrupt, SystemExit, ExternalShutdownException):
        pass  # SIGINT, SIGTERM, or ROS: a node that is ended has done all that it should
    finally:  # in this order: what is left to the end of the process may be freed under a running thread
        executor.shutdown()
        node.destroy_node()
        rclpy.try_shutdown()


class RosNode:
    """The callbacks of the node.

    Attributes:
        node: The node of ROS.
        settings: Its parameters.
    """

    model: RosModel
    states: CompleteStates

    def __init__(self, node: Any, load: Load, settings: RosSettings) -> None:
        """Load the robot, or wait for the topic `robot_description`."""
        self.node, self._load, self.settings = node, load, declared(node, settings)
        self._health, self._said, self._due, self._text = Health(), set[str](), time.monotonic(), ""
        if self.settings.robot:
            self._begin(self.settings.robot)
        else:
            self._waiting = node.create_subscription(String, "robot_description", self._described, LATCHED)
            node.get_logger().info("no file of a robot is named: waiting for the topic 'robot_description'")

    def _described(self, message: String) -> None:
        """Load the first robot of the topic."""
        if not self._text:
            with tempfile.TemporaryDirectory() as folder:
                file = Path(folder, "robot_description.urdf")
                file.write_text(message.data)
                self._begin(str(file))
            self._text = message.data
        elif message.data != self._text:
            self.node.get_logger().warning("another robot_description is not loaded: start the node again")

    def _begin(self, file: str) -> None:
        """Load a robot, and open the topics."""
        node, settings = self.node, self.settings
        robot = self._load(file, settings.motors)
        self.model = RosModel(robot, settings.joints, settings.effects, settings.payload_link)
        if settings.payload_link:
            self.model.load(settings.payload_mass, settings.payload_centre)
        self._own = settings.renamed
        self._drivers = {own: name for name, own in self._own.items()}
        check_names([*self._drivers], self.model.joints.names)
        self.states, self._commanded = (CompleteStates(self.model, self._own) for _ in range(2))
        self._out = {
            name: node.create_publisher(kind, name, WAITING)
            for name, kind in (
                ("joint_states", JointState), ("gravity_efforts", JointState), ("feedforward", JointState),
                ("motor_trajectory", JointTrajectory), ("joint_trajectory", JointTrajectory),
                ("/diagnostics", DiagnosticArray),
            )
        }  # fmt: skip
        for name, kind, answer in (
            ("motor_states", JointState, self._measured),
            ("commanded_states", JointState, self._wanted),
            ("trajectory", JointTrajectory, self._planned),
        ):
            qos = PLAN if kind is JointTrajectory else SENSOR
            heard = node.create_subscription(kind, name, self._guarded(name, answer), qos)
            for other, out in self._out.items():
                if out.topic_name == heard.topic_name:
                    raise ModelError(
                        f"'{name}' and '{other}' are both the topic '{out.topic_name}': the node would hear "
                        f"itself; call one of them otherwise, as in -r {other}:=complete_{other}"
                    )
        node.create_timer(AGAIN, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME))
        node.add_on_set_parameters_callback(self._changed)
        node.get_logger().info(f"'{robot.name}' is ready: motors {', '.join(self.model.robot.motors)}")

    def _guarded(self, topic: str, answer: Callable[[Any], None]) -> Callable[[Any], None]:
        """Return a callback that refuses a wrong message, and says so.

        Where positions are out of reach this takes long, and states wait meanwhile. After two refused ones,
        those that wait are refused unread, so that the node does not fall behind.
        """
        until, again = 0.0, False

        def guarded(message: Any) -> None:
            """Answer a message."""
            nonlocal until, again
            if time.monotonic() < until:
                self._health.refused += 1
                return
            began = time.thread_time()
            try:
                answer(message)
                again = False
            except HybridynError as error:
                spent = time.thread_time() - began
                if again and spent > LONG and isinstance(message, JointState):
                    until = time.monotonic() + spent
                again = True
                self._say(self._health.refuse(topic, error))

        return guarded

    def _say(self, line: str) -> None:
        """Say why a message is refused, unless a line like it was said a moment ago."""
        alike = NUMBER.sub("", line)  # of states that are out of reach, each has its own numbers
        if alike not in self._said and len(self._said) < LINES:
            self._said.add(alike)
            self.node.get_logger().warning(line)
            self._diagnose()

    def _measured(self, message: JointState) -> None:
        """Publish the complete state, and the efforts that hold it if anybody asks."""
        if self.settings.rate and (now := time.monotonic()) < self._due:
            return
        if self.settings.rate:
            self._due = max(self._due, now - 1 / self.settings.rate) + 1 / self.settings.rate
        found = self.states.complete(_numbers(message), _nanoseconds(message.header.stamp))
        self._out["joint_states"].publish(_message(message.header, found))
        self._health.completed += 1
        if self._out["gravity_efforts"].get_subscription_count():
            still = np.zeros(self.model.robot.nv)
            tau = self.model.efforts(self.states.q, still, still)
            self._out["gravity_efforts"].publish(_message(message.header, self._of_motors(self.states, tau)))

    def _wanted(self, message: JointState) -> None:
        """Publish the efforts of a commanded state whose given joints do not accelerate."""
        at = self._commanded
        at.complete(_numbers(message), _nanoseconds(message.header.stamp))
        tau = self.model.efforts(at.q, at.v, at.a)
        self._out["feedforward"].publish(_message(message.header, self._of_motors(at, tau)))

    def _of_motors(self, at: CompleteStates, tau: Array) -> JointNumbers:
        """Return positions, rates and efforts of the motors, which have the names that their driver knows."""
        robot, names = self.model.robot, [self._drivers.get(x, x) for x in self.model.robot.motors]
        return JointNumbers(names, self.model.motor_positions(at.q), at.v[robot.motor_v], tau)

    def _planned(self, message: JointTrajectory) -> None:
        """Publish the other trajectory."""
        points = [
            JointPoint(_nanoseconds(x.time_from_start), x.positions, x.velocities, x.accelerations)
            for x in message.points
        ]
        given = [self._own.get(name, name) for name in message.joint_names]
        names, found = turned(
            self.model, given, points, self.states.q, efforts=self.settings.trajectory_efforts
        )
        of_motors = not set(given) <= {*self.model.robot.motors}
        self._out["motor_trajectory" if of_motors else "joint_trajectory"].publish(
            JointTrajectory(
                header=message.header,
                joint_names=[self._drivers.get(name, name) for name in names],
                points=[
                    JointTrajectoryPoint(
                        positions=x.positions, velocities=x.velocities, accelerations=x.accelerations,
                        effort=x.effort,
                        time_from_start=Duration(sec=x.time // SECOND, nanosec=x.time % SECOND),
                    )
                    for x in found
                ],
            )
        )  # fmt: skip

    def _changed(self, parameters: Sequence[Any]) -> SetParametersResult:
        """Set the payload."""
        given = {one.name: one.value for one in parameters}
        try:
            mass, centre = (
                checked(name, given.get(name, self.node.get_parameter(name).value)) for name in CHANGEABLE
            )
            self.model.load(mass, centre)
        except HybridynError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _tick(self) -> None:
        """Publish the diagnostics, and let lines be said again."""
        self._said.clear()
        self._diagnose()

    def _diagnose(self) -> None:
        """Publish the diagnostics."""
        well, line, values = self._health.told(self.states)
        status = DiagnosticStatus(
            level=DiagnosticStatus.OK if well else DiagnosticStatus.WARN,
            name=f"{self.node.get_name()}: loops", message=line, hardware_id=self.model.robot.name,
            values=[KeyValue(key=key, value=value) for key, value in values.items()],
        )  # fmt: skip
        out = DiagnosticArray(status=[status])
        out.header.stamp = self.node.get_clock().now().to_msg()
        self._out["/diagnostics"].publish(out)


def _nanoseconds(stamp: Any) -> int:
    """Return a time or a duration of ROS [ns]."""
    return int(stamp.sec) * SECOND + int(stamp.nanosec)


def _numbers(message: JointState) -> JointNumbers:
    """Return the numbers of a message."""
    return JointNumbers(message.name, message.position, message.velocity, message.effort)


def _message(header: Any, numbers: JointNumbers) -> JointState:
    """Return numbers as a message."""
    out = JointState(header=header, name=list(numbers.names))
    for name in ("position", "velocity", "effort"):
        if (x := getattr(numbers, name)) is not None:
            setattr(out, name, array("d", np.asarray(x, dtype=float).tobytes()))
    return out
