"""Stacks of one to a thousand equal modules, spatial and planar, with drawn states."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from hybridyn import HybridRobot, assemble, idm
from hybridyn.description import Description
from hybridyn.description.records import Closure, Joint, Link
from hybridyn.structure.building import build_robot
from tests.robots.shipped import shipped
from tests.tools.long_chain import stack

SPATIAL, PLANAR = "6-UPS", "planar 3-RPR"
DOWN = {SPATIAL: (0.0, 0.0, -9.81), PLANAR: (0.0, -9.81, 0.0)}
OUTPUTS = {SPATIAL: ("x", "y", "z", "roll", "pitch", "yaw"), PLANAR: ("x", "y", "yaw")}


@lru_cache
def module(kind: str) -> Description:
    """Return the robot of one module; base "m1_base", platform "m1_platform"."""
    return shipped("gough_stewart") if kind == SPATIAL else rpr()


def rpr() -> Description:
    """Lay out a planar 3-RPR: three slides between hinges hold a platform in the x-y plane.

    Its two closures are hinges in space, of five rows each, of which two are independent.
    """
    feet, points = [(-0.5, 0.0), (0.5, 0.0), (0.1, 0.1)], [(-0.25, 0.0), (0.25, 0.0), (-0.2, 0.1)]
    up, z, x = np.array([0.0, 0.6]), np.eye(3)[2], np.eye(3)[0]

    def bar(name: str, mass: float, com: float, length: float) -> Link:
        inertia = mass * length**2 / 12 * np.diag([0.01, 1.0, 1.0])
        return Link(name, mass, np.array([com, 0.0, 0.0]), inertia)

    def placed(xy: np.ndarray, angle: float = 0.0) -> np.ndarray:
        M = np.eye(4)
        M[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
        M[:2, 3] = xy
        return M

    links = [bar("m1_base", 5.0, 0.0, 1.0), bar("m1_platform", 3.0, 0.05, 0.6)]
    joints, closures = [], []
    for i, (foot, point) in enumerate(zip(np.array(feet), np.array(points), strict=True), start=1):
        along, leg = up + point - foot, f"m1_leg{i}"
        angle, length = float(np.arctan2(along[1], along[0])), float(np.hypot(*along))
        links += [bar(f"{leg}_cylinder", 1.2, 0.2, 0.4), bar(f"{leg}_rod", 0.5, -0.2, 0.4)]
        hinge = Joint(f"{leg}_hinge", "revolute", "m1_base", f"{leg}_cylinder", placed(foot, angle), z)
        out = np.array([length, 0.0])
        slide = Joint(f"{leg}_slide", "prismatic", f"{leg}_cylinder", f"{leg}_rod", placed(out), x)
        joints += [hinge, slide]
        if i == 1:
            end, still = f"{leg}_end", np.zeros(3)
            links.append(Link(end, 0.0, still, np.zeros((3, 3))))
            joints.append(
                Joint(f"{leg}_wrist", "revolute", f"{leg}_rod", end, placed(np.zeros(2), -angle), z)
            )
            joints.append(Joint(f"{leg}_mount", "fixed", end, "m1_platform", placed(-point), z))
        else:
            pin = Closure(
                f"{leg}_pin",
                "revolute",
                "m1_platform",
                placed(point),
                f"{leg}_rod",
                np.eye(4),
                (0, 1, 2),
                "parallel",
            )
            closures.append(pin)
    motors = tuple(f"m1_leg{i}_slide" for i in (1, 2, 3))
    return Description("planar_rpr", tuple(links), tuple(joints), tuple(closures), motors=motors)


@dataclass(frozen=True)
class State:
    """A stack with one state, and the accelerations that its platforms were asked for.

    Attributes:
        robot: The robot.
        q, v, a: On the spanning tree, shapes (nq,), (nv,), (nv,).
    """

    robot: HybridRobot
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray

    @property
    def joints(self) -> dict[str, int]:
        """Where each joint stands in q and v (all have one freedom)."""
        return self.robot.joint_index

    @property
    def motors(self) -> dict[str, int]:
        """Where each motor stands in tau."""
        return {name: i for i, name in enumerate(self.robot.motors)}

    @property
    def tau(self) -> np.ndarray:
        """Efforts of the size that the motion takes."""
        return idm(self.robot, self.q, self.v, self.a)


@lru_cache
def drawn(kind: str, count: int, seed: int = 0) -> State:
    """Draw a stack's state: each platform near home, moving and accelerating on its base."""
    one, rng = module(kind), np.random.default_rng([seed, count])
    alone = build_robot(one, gravity=DOWN[kind])
    names = OUTPUTS[kind]
    home = {"z": 0.7} if kind == SPATIAL else {"y": 0.6}
    pose, rate, acceleration = (
        {name: size * rng.uniform(-1, 1, count) for name in names} for size in (0.04, 0.1, 0.3)
    )
    pose = {name: x + home.get(name, 0.0) for name, x in pose.items()}
    states = assemble(alone, platforms={"m1_platform@m1_base": (pose, rate, acceleration)})
    robot = build_robot(stack(one, count) if count > 1 else replace(one, name="stack"), gravity=DOWN[kind])
    q, v, a = np.zeros((3, robot.nv))
    for out, x in zip((q, v, a), states, strict=True):
        for name, number in alone.joint_index.items():
            for k in range(count):
                out[robot.joint_index[name.replace("m1_", f"m{k + 1}_", 1)]] = x[k, number]
    return State(robot, q, v, a)
