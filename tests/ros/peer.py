"""The other side of the node: a process of the node, and what a driver and a viewer publish and hear."""

import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from tests import ROOT
from tests.support.waiting import wait_until

#: On this machine alone; runs of other tests have other domains.
DOMAIN = 10 + os.getpid() % 90
WHERE = {
    "ROS_DOMAIN_ID": f"{DOMAIN}",
    "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4",  # shared memory stays where a process was killed
}
#: Messages that wait until they are read.
MANY = 20_000


class NodeProcess:
    """The node in a process of its own."""

    def __init__(self, folder: Path, *words: str, compiled: bool = False) -> None:
        """Start it. `compiled`: whether there is a compiler."""
        env = os.environ | WHERE | {"PYTHONPATH": str(ROOT), "ROS_LOG_DIR": str(folder)}
        if not compiled:
            env["CC"] = str(folder / "none")
        self.file = folder / "log.txt"
        with self.file.open("a") as out:
            command = [sys.executable, "-m", "hybridyn", "ros", *words]
            self.process = subprocess.Popen(command, env=env, stdout=out, stderr=out, cwd=ROOT)

    @property
    def log(self) -> list[str]:
        """Its log, by lines."""
        return self.file.read_text().splitlines()

    @property
    def memory(self) -> float:
        """Its resident memory [MB]."""
        pages = int(Path(f"/proc/{self.process.pid}/statm").read_text().split()[1])
        return pages * os.sysconf("SC_PAGE_SIZE") / 1e6

    def end(self) -> int:
        """End it as Ctrl-C does, and return its status."""
        self.process.send_signal(2)
        return self.process.wait()


class Peer:
    """A driver and a viewer.

    Attributes:
        heard: Messages by topic.
    """

    def __init__(self) -> None:
        os.environ.update(WHERE)
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.node = rclpy.create_node("peer", context=self.context)
        self.executor = rclpy.executors.SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.heard: dict[str, list[Any]] = {}
        self.out = {
            "motor_states": self.node.create_publisher(JointState, "motor_states", qos_profile_sensor_data),
            "commanded_states": self.node.create_publisher(JointState, "commanded_states", MANY),
            "trajectory": self.node.create_publisher(JointTrajectory, "trajectory", MANY),
        }
        for name, kind in (
            ("joint_states", JointState), ("gravity_efforts", JointState), ("feedforward", JointState),
            ("motor_trajectory", JointTrajectory), ("joint_trajectory", JointTrajectory),
            ("/diagnostics", DiagnosticArray),
        ):  # fmt: skip
            self.node.create_subscription(kind, name, self._hears(name), MANY)

    def _hears(self, topic: str) -> Callable[[Any], None]:
        return self.heard.setdefault(topic, []).append

    def wait(self, holds: Callable[[], bool], what: str) -> None:
        """Wait until something holds; messages come meanwhile."""
        wait_until(holds, what, lambda seconds: self.executor.spin_once(timeout_sec=seconds))

    def meet(self) -> None:
        """Wait until the node hears this one, and this one the node."""
        node = self.node
        self.wait(
            lambda: (
                all(out.get_subscription_count() for out in self.out.values())
                and all(node.count_publishers(topic) for topic in self.heard)
            ),
            "the node is there",
        )

    def state(
        self, stamp: float, names: Sequence[str], position: Sequence[float], **numbers: Any
    ) -> JointState:
        """Return a message of joints; `stamp` [s]."""
        out = JointState(name=list(names), position=[float(x) for x in position], **numbers)
        out.header.stamp.sec, out.header.stamp.nanosec = int(stamp), round(stamp % 1 * 1e9)
        return out

    def ask(self, topic: str, message: Any, answer: str) -> Any:
        """Publish a message, and return what comes on another topic."""
        heard = self.heard[answer]
        heard.clear()
        self.out[topic].publish(message)
        stamp = message.header.stamp
        self.wait(lambda: any(one.header.stamp == stamp for one in heard), f"an answer on {answer}")
        return heard[-1]

    def end(self) -> None:
        """End the process's part in ROS."""
        self.executor.shutdown()
        self.context.try_shutdown()
