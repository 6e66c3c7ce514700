"""The home posture of an MJCF file: its keyframe, else MuJoCo's reference posture."""

from __future__ import annotations

import numpy as np

from ..names import listed
from ..records import Array
from ..robot_file import RobotFile
from .compiling import Compiled
from .roots import Root

#: Name of the keyframe that is taken where there are several.
HOME = "home"


def add_home(robot: RobotFile, compiled: Compiled, root: Root) -> None:
    """Add the home posture to the robot: the keyframe "home", else the first, else `qpos0`."""
    model = compiled.model
    q = np.array(model.qpos0)
    if model.nkey:
        names = [compiled.name("key", number) for number in range(model.nkey)]
        chosen = names.index(HOME) if HOME in names else 0
        q = np.array(model.key_qpos[chosen])
        if model.nkey > 1 and HOME not in names:
            robot.notes.append(
                f"home is the first of {model.nkey} keyframes ('{names[0]}'); to use another one, rename it "
                f"to 'home': {listed(names[1:])}"
            )
    numbers = {name: index for index, name in enumerate(compiled.joints)}
    for joint in robot.joints:
        if joint.kind != "fixed":
            start = int(model.jnt_qposadr[numbers[joint.name]])
            robot.home[joint.name] = _coordinates(joint.kind, q[start : start + 7])
    if root.joint is not None:
        start = int(model.jnt_qposadr[root.joint])
        robot.base_home = _coordinates("floating", q[start : start + 7])


def _coordinates(kind: str, q: Array) -> tuple[float, ...]:
    """Return Pinocchio's coordinates (quaternion x, y, z, w) of MuJoCo's (w, x, y, z)."""
    if kind == "spherical":
        return _turned(q[:4])
    if kind == "floating":
        return (*(float(x) for x in q[:3]), *_turned(q[3:7]))
    return (float(q[0]),)


def _turned(quaternion: Array) -> tuple[float, ...]:
    w, x, y, z = (float(number) for number in quaternion / np.linalg.norm(quaternion))
    return (x, y, z, w)
