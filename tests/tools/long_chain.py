"""Run the direct model of a stack of n Gough-Stewart modules; print nv, peak memory [MB] and what comes back.

The last number is the largest difference between efforts and those of the inverse model, relative to the
largest of the terms that cancel in them: all modules' mass, carried along by the lowest module at a lever of
the stack's height.
"""

import re
import resource
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

import hybridyn
from hybridyn.description import Description
from hybridyn.structure.building import build_robot
from tests.robots.shipped import shipped

SAMPLES = 4


def stack(one: Description, count: int) -> Description:
    """Stack a robot of one module "m1_..." on itself: bases of the others are the platforms below."""

    def name(text: str, k: int) -> str:
        if text == "m1_base":
            return "m1_base" if k == 1 else f"m{k - 1}_platform"
        return text.replace("m1_", f"m{k}_", 1)

    numbers, moving = range(1, count + 1), [link for link in one.links if link.name != "m1_base"]
    links = [link for link in one.links if link.name == "m1_base"]
    links += [replace(link, name=name(link.name, k)) for k in numbers for link in moving]
    joints = [
        replace(j, name=name(j.name, k), parent=name(j.parent, k), child=name(j.child, k))
        for k in numbers
        for j in one.joints
    ]
    closures = [
        replace(c, name=name(c.name, k), link_a=name(c.link_a, k), link_b=name(c.link_b, k))
        for k in numbers
        for c in one.closures
    ]
    motors = tuple(name(motor, k) for k in numbers for motor in one.motors)
    return Description("stack", tuple(links), tuple(joints), tuple(closures), motors=motors)


def peak_megabytes() -> float:
    """Return the most memory that this program had; `ru_maxrss` would count what started it."""
    status = Path("/proc/self/status")
    if status.exists():
        return float(re.findall(r"VmHWM:\s+(\d+) kB", status.read_text())[0]) / 1e3
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1e6 if sys.platform == "darwin" else 1e3)


def main(count: int) -> None:
    """Build the stack, hang it in its home posture, drive it."""
    robot = build_robot(stack(shipped("gough_stewart"), count))
    q, v = np.tile(robot.home, (SAMPLES, 1)), np.zeros((SAMPLES, robot.nv))
    tau = 100 * np.random.default_rng(0).normal(size=(SAMPLES, len(robot.motors)))
    a = hybridyn.ddm(robot, q, v, tau)
    back = hybridyn.idm(robot, q, v, a)
    height = count * robot.modules[0].mechanism.length
    largest = sum(link.mass for link in robot.description.links) * height * np.abs(a).max()
    print(robot.nv, peak_megabytes(), np.abs(back - tau).max() / largest)


if __name__ == "__main__":
    main(int(sys.argv[1]))
