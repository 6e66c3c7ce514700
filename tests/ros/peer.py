"""The other side of the node: a process of the node, and what a driver and a viewer publish and hear."""

import itertools
import os
import signal
import socket
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
from tests.support.waiting import PATIENCE, wait_until


def free_domain() -> tuple[int, socket.socket]:
    """Return a domain that no other process of tests has, and what holds it until this process ends.

    Domains of DDS have 250 ports each, from 7400 on, of which the sixth is not used; this process takes it.
    Ports above domain 100 are those of other programs.
    """
    for domain in range(10, 100):
        held = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            held.bind(("127.0.0.1", 7400 + 250 * domain + 5))
        except OSError:
            held.close()
        else:
            return domain, held
    raise AssertionError("every domain is taken")


DOMAIN, HELD = free_domain()
#: On this machine alone, and without shared memory, which stays on the machine when a process is killed.
WHERE = {
    "ROS_DOMAIN_ID": f"{DOMAIN}",
    "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4",
}
#: Messages that wait until they are read.
MANY = 20_000
#: Turns of hearing, of 20 ms or a message each, after which a question is asked again.
TURNS = 50


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

    def end(self, number: int = signal.SIGINT) -> int:
        """End it by a signal, as Ctrl-C does, and return its status."""
        self.process.send_signal(number)
        return self.process.wait(PATIENCE)


class Peer:
    """A driver and a viewer, and the processes of nodes that they work with.

    Attributes:
        heard: Messages by topic.
    """

    def __init__(self, namespace: str = "") -> None:
        os.environ.update(WHERE)
        self.context, self._served = rclpy.Context(), list[NodeProcess]()
        rclpy.init(context=self.context)
        self.node = rclpy.create_node("peer", namespace=namespace, context=self.context)
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

    def start(self, folder: Path, *words: str, compiled: bool = False) -> NodeProcess:
        """Start a node, which must not end while anything is waited for."""
        self._served.append(NodeProcess(folder, *words, compiled=compiled))
        return self._served[-1]

    def wait(self, holds: Callable[[], bool], what: str) -> None:
        """Wait until something holds; messages come meanwhile."""
        started = [one for one in self._served if one.process.poll() is None]

        def spin(seconds: float) -> None:
            """Hear messages."""
            self.executor.spin_once(timeout_sec=seconds)
            for one in started:
                assert one.process.poll() is None, f"waiting for {what}, the node ended: {one.log[-3:]}"

        wait_until(holds, what, spin)

    def ask_until(self, ask: Callable[[], Any], holds: Callable[[], bool], what: str) -> None:
        """Ask until something holds.

        Each side of DDS finds the other at a time of its own. What is published before both have done so is
        lost, so that one question may never be answered.
        """
        turns = itertools.count()

        def asked() -> bool:
            """Ask in one turn of many, and return whether it holds."""
            if next(turns) % TURNS == 0:
                ask()
            return holds()

        self.wait(asked, what)

    def ask(self, topic: str, message: Any, answer: str) -> Any:
        """Publish a message, and return what comes on another topic with the same time."""
        heard, stamp = self.heard[answer], message.header.stamp
        heard.clear()
        self.ask_until(
            lambda: self.out[topic].publish(message),
            lambda: any(one.header.stamp == stamp for one in heard),
            f"an answer on {answer} to what is published on {topic}",
        )
        return next(one for one in heard if one.header.stamp == stamp)

    def state(
        self, stamp: float, names: Sequence[str], position: Sequence[float], **numbers: Any
    ) -> JointState:
        """Return a message of joints; `stamp` [s]."""
        out = JointState(name=list(names), position=[float(x) for x in position], **numbers)
        out.header.stamp.sec, out.header.stamp.nanosec = int(stamp), round(stamp % 1 * 1e9)
        return out

    def end(self) -> None:
        """End the process's part in ROS, and nodes that a test has left."""
        for one in self._served:
            one.process.kill()
            one.process.wait()
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()
