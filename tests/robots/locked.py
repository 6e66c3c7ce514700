"""Robots with parts that loops lock: a hinge in the leg of a five-bar, and modules without any motion."""

from collections.abc import Sequence

import numpy as np

from hybridyn.structure.building import build_robot
from hybridyn.structure.robot import HybridRobot
from tests.robots.parts import five_bar
from tests.robots.sketch import Sketch

Z = np.array([0.0, 0.0, 1.0])
#: Where a module without motions is: "on" an arm, "below" it, or "beside" a five-bar; "alone" nothing moves.
PLACES = ("on", "below", "beside", "alone")


def hinged_five_bar(motors: Sequence[str] = ("ja", "jc"), *, both: bool = False) -> HybridRobot:
    """Return a five-bar of the arms ja-jb and jc-jd, whose second arm has one more hinge, jx, in its elbow.

    The axis of jx lies in no plane of the bars, so that the loop locks it. `named` gives the joints' names.

    Args:
        motors: Ends of the names of the joints with motors.
        both: Whether the first arm has such a hinge, too, jy.
    """
    s = Sketch(np.random.default_rng(0))
    s.fixed_links = 0.0
    near = s.joint("revolute", "base", np.array([0.0, 0.0, 0.0]), Z, stem="ja")
    if both:
        near = s.joint("revolute", near, np.array([-0.1, 0.2, 0.0]), np.array([1.0, 0.4, 0.0]), stem="jy")
    near = s.joint("revolute", near, np.array([-0.2, 0.4, 0.0]), Z, stem="jb")
    far = s.joint("revolute", "base", np.array([0.5, 0.0, 0.0]), Z, stem="jc")
    far = s.joint("revolute", far, np.array([0.6, 0.2, 0.0]), np.array([0.0, 1.0, 0.3]), stem="jx")
    far = s.joint("revolute", far, np.array([0.7, 0.4, 0.0]), Z, stem="jd")
    s.close("revolute", near, far, np.array([0.2, 0.7, 0.0]), Z)
    s.motors = [j.name for end in motors for j in s.joints if j.name.endswith(end)]
    return build_robot(s.description("hinged_five_bar"))


def named(robot: HybridRobot, *ends: str) -> list[str]:
    """Return the joints whose names end so."""
    return [name for end in ends for name in robot.joints if name.endswith(end)]


def with_truss(place: str, *, motor: bool = False) -> HybridRobot:
    """Return a robot with two bars on hinges that meet in a third, so that neither moves.

    Args:
        place: One of `PLACES`.
        motor: Whether one of the hinges has a motor.
    """
    s = Sketch(np.random.default_rng(0))
    s.fixed_links = 0.0

    def truss(base: str) -> str:
        """Add the two bars; return one."""
        at = s.poses[base][:3, 3] + 0.1
        bars = [
            s.joint("revolute", base, at + x, Z, stem="truss", motor=motor and not x.any())
            for x in (np.zeros(3), np.array([0.5, 0.0, 0.0]))
        ]
        s.close("revolute", *bars, at + np.array([0.3, 0.3, 0.0]), Z)
        return bars[0]

    def arm(link: str) -> str:
        """Add two hinges with motors."""
        for _ in range(2):
            link = s.joint("revolute", link, s.poses[link][:3, 3] + 0.2, motor=True)
        return link

    if place == "on":
        truss(arm("base"))
    elif place == "below":
        arm(truss("base"))
    else:
        truss("base")
    if place == "beside":
        five_bar(s, "base", s.place())
    return build_robot(s.description(f"truss_{place}"))
