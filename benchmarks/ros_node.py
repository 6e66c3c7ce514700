"""Latency, processor time and memory of `hybridyn ros`: `python -m benchmarks.ros_node [ROBOT ...]`.

A driver publishes states of the motors at 500 Hz over DDS on this machine, a viewer hears the complete ones.
Latency is from publishing to hearing, and contains the driver's and the viewer's own time in Python.
Processor time is that of all threads of the node, by blocks of 100 messages. Memory is the resident set.
`--count N` sets the number of messages, `--rate HZ` their rate.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState

import hybridyn

#: Rate of the driver [Hz], messages before the measurement, messages of a block.
RATE, WARM, BLOCK = 500, 500, 100
#: On this machine alone.
WHERE = {"ROS_DOMAIN_ID": "99", "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}


def cpu_time(pid: int) -> float:
    """Return the processor time of all threads of a process [s]."""
    tasks = Path(f"/proc/{pid}/task").iterdir()
    return sum(int((task / "schedstat").read_text().split()[0]) for task in tasks) / 1e9


def memory(pid: int) -> float:
    """Return the resident memory of a process [MB]."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


class Driver:
    """Publishes states of the motors, and hears the complete ones."""

    def __init__(self, name: str) -> None:
        self.robot = hybridyn.load(name)
        self.node: Any = rclpy.create_node("driver")
        self.out = self.node.create_publisher(JointState, "motor_states", qos_profile_sensor_data)
        self.node.create_subscription(JointState, "joint_states", self._hear, 1000)
        self.sent, self.heard = list[float](), dict[int, float]()

    def _hear(self, message: Any) -> None:
        self.heard[message.header.stamp.sec * RATE + message.header.stamp.nanosec * RATE // 10**9] = (
            time.perf_counter()
        )

    def meet(self) -> None:
        """Publish until the node answers: before, each side may not have found the other."""
        message = JointState(name=list(self.robot.motors))
        message.position = self.robot.home[self.robot.motor_q].tolist()
        while not self.heard:
            self.out.publish(message)
            rclpy.spin_once(self.node, timeout_sec=1.0)
        self.heard.clear()

    def run(self, pid: int, count: int, rate: float) -> tuple[list[float], list[float]]:
        """Publish at a rate, and return processor time [s] and memory [MB] after each block."""
        home = self.robot.home[self.robot.motor_q]
        used, size, start = list[float](), list[float](), time.perf_counter()
        for i in range(count):
            if i % BLOCK == 0:
                used.append(cpu_time(pid))
                size.append(memory(pid))
            message = JointState(name=list(self.robot.motors))
            message.position = (home + 0.01 * np.sin(0.02 * i + np.arange(len(home)))).tolist()
            message.velocity = (2e-4 * RATE * np.cos(0.02 * i + np.arange(len(home)))).tolist()
            message.header.stamp.sec, message.header.stamp.nanosec = i // RATE, i % RATE * 10**9 // RATE + 1
            self.sent.append(time.perf_counter())
            self.out.publish(message)
            while (left := start + (i + 1) / rate - time.perf_counter()) > 0:
                rclpy.spin_once(self.node, timeout_sec=left)
        end = time.perf_counter() + 2
        while len(self.heard) < count and time.perf_counter() < end:
            rclpy.spin_once(self.node, timeout_sec=0.1)
        return used, size


def measure(name: str, count: int, rate: float = RATE) -> str:
    """Start a node for a robot, and return a line of what was measured."""
    command = [sys.executable, "-m", "hybridyn", "ros", name]
    process = subprocess.Popen(command, env=os.environ | WHERE, stderr=subprocess.DEVNULL)
    try:
        driver = Driver(name)
        driver.meet()
        used, size = driver.run(process.pid, count, rate)
        late = [1e3 * (at - driver.sent[i]) for i, at in driver.heard.items() if i >= WARM]
        each = 1e3 * np.diff(used)[WARM // BLOCK :] / BLOCK
        p50, p90, p99, worst = np.percentile(late, [50, 90, 99, 100])
        grown = size[-1] - size[WARM // BLOCK]
        return (
            f"{name}: {len(driver.heard)} of {count} heard; latency [ms] median {p50:.2f}, 90 % {p90:.2f}, "
            f"99 % {p99:.2f}, worst {worst:.1f}; processor time per message [ms] median "
            f"{np.median(each):.3f}, largest block {each.max():.3f}; memory {size[-1]:.0f} MB, grown by "
            f"{grown:.2f} MB"
        )
    finally:
        process.send_signal(2)
        process.wait()


def main(words: list[str]) -> None:
    """Measure the robots that are named."""
    count = int(words[words.index("--count") + 1]) if "--count" in words else 10_000
    rate = float(words[words.index("--rate") + 1]) if "--rate" in words else RATE
    robots = [word for word in words if word.isidentifier()] or ["five_bar", "stewart_ur5", "lx4"]
    os.environ.update(WHERE)
    rclpy.init()
    for name in robots:
        print(measure(name, count, rate), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
