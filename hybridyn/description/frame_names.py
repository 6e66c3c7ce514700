"""Build the closures that frame names state, and the closures between two frames that a side-car pairs."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np

from ..errors import ModelError
from .closure_forms import FORMS
from .names import listed
from .records import Closure
from .robot_file import MotorStatement, RobotFile

CLOSURE_TYPES = {"3d": FORMS["point"], "6d": FORMS["fixed"]}
NAMED_FRAME = re.compile(r"closedloop(\d+)")
HINGES = ("revolute", "continuous")


def apply_frame_names(robot: RobotFile) -> None:
    """Add the closures and motors that names state: the convention of Gepetto's models without a side-car.

    Frames whose names contain `closedloop<N>`, two for every N, are welded (6d). Joints whose names contain
    `spherical` become spherical joints. Joints whose names contain `motor` are driven.

    Raises:
        ModelError: The number of frames for an N is not two.
    """
    frames = {link.name: link.name for link in robot.links}
    frames |= {joint.name: joint.child for joint in robot.joints}
    pairs: dict[str, dict[str, None]] = {}
    for name, link in frames.items():
        if (match := NAMED_FRAME.search(name)) and "frame" not in name:
            pairs.setdefault(match[1], {})[link] = None
    if not pairs or robot.closures:
        return
    for number, links in pairs.items():
        if len(links) != 2:
            raise ModelError(
                f"{len(links)} frames are named closedloop{number} instead of two: {listed(links)}; "
                "list the pairs in a side-car robot.yaml (closed_loop)",
                file=robot.file,
            )
        link_a, link_b = links
        robot.closures.append(weld_or_point("-".join(links), "6d", link_a, link_b, None))
    balls = {joint.name for joint in robot.joints if "spherical" in joint.name and joint.kind in HINGES}
    robot.joints = [replace(j, kind="spherical") if j.name in balls else j for j in robot.joints]
    motors = tuple(j.name for j in robot.joints if "motor" in j.name and j.kind in (*HINGES, "prismatic"))
    if motors:
        robot.motors.append(MotorStatement("names", "joints that are named 'motor'", motors, robot.file))
    robot.notes.append(
        "no side-car: frames named closedloop are welded pairwise, "
        f"{len(balls)} joints named spherical are balls"
    )


def weld_or_point(name: str, kind: str, link_a: str, link_b: str, line: int | None) -> Closure:
    """Return the closure that makes the origins (3d) or the whole frames (6d) of two links coincide."""
    form = CLOSURE_TYPES[kind]
    return Closure(name, kind, link_a, np.eye(4), link_b, np.eye(4), form.translations, form.rotation, line)
