"""Define what an engine does here, and what it gets: the robot's own file, or its hinges as points.

Only rigid bodies are compared: gravity, inertia and closures. Friction, damping, springs, rotors, contacts
and limits are switched off in every engine.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from typing import Protocol

import numpy as np
import pinocchio as pin
from lxml import etree

from ...description.names import listed
from ...description.reading import open_robot
from ...errors import HybridynError
from ...joints.kinds import JointKind
from ...spatial import Array
from ...structure.building import rebuilt
from ...structure.robot import HybridRobot

#: Largest cross product of parallel unit vectors.
PARALLEL = 1e-12
#: Elements of a URDF that hold shapes; engines would look for meshes in vain.
SHAPES = ("visual", "collision")
#: Formats that engines read, by the root element.
FORMATS = {"robot": "URDF", "mujoco": "MJCF"}


class NotComparableError(HybridynError):
    """An engine refuses the robot, or makes another robot of it; the message says what."""


class PeerEngine(Protocol):
    """A robot inside another engine, in the robot's own coordinates.

    Attributes:
        way: How the robot came into the engine, in words.
        notes: Remarks.
    """

    way: str
    notes: tuple[str, ...]

    def forward(self, q: Array, v: Array, force: Array) -> Array:
        """Compute the accelerations, shape (nv,), under generalised forces on all joints, shape (nv,)."""
        ...

    def inverse(self, q: Array, v: Array, a: Array) -> Array:
        """Compute the generalised forces that move the tree without its closures, shape (nv,)."""
        ...

    def freedoms(self, q: Array) -> int:
        """Count the freedoms that the engine's constraints leave at a posture."""
        ...


@dataclass(frozen=True)
class OwnFile:
    """A robot's own file as other engines may read it.

    Attributes:
        path: Its path, or "" for a robot that has none.
        format: "URDF", "MJCF" or "".
        text: Its text, xacro expanded, shapes of a URDF left out.
    """

    path: str = ""
    format: str = ""
    text: str = ""


def own_file(
    robot: HybridRobot,
    xacro_args: Mapping[str, object] | None = None,
    package_dirs: Sequence[str | PathLike[str]] = (),
) -> OwnFile:
    """Return the file of a robot; empty if it has none, or none that an engine reads."""
    path = robot.description.source
    try:
        root = open_robot(path or "", dict(xacro_args or {}), package_dirs)
    except HybridynError:  # a robot from memory, or a binary format
        return OwnFile()
    if root.tag == "robot":
        etree.strip_elements(root.xml, *SHAPES, with_tail=False)
    return OwnFile(path or "", FORMATS.get(root.tag, ""), etree.tostring(root.xml, encoding="unicode"))


def refuse_other_joints(robot: HybridRobot, theirs: Sequence[str], engine: str) -> None:
    """Raise if the joints of an engine are not those of the robot.

    Raises:
        NotComparableError: Joints are missing, or there are others.
    """
    missing = [name for name in robot.joints if name not in theirs]
    more = [name for name in theirs if name not in robot.joints]
    if missing or more:
        parts = [f"without joints {listed(missing)}"] if missing else []
        parts += [f"with joints {listed(more)}"] if more else []
        raise NotComparableError(f"{engine} makes another robot of it: {' and '.join(parts)}")


def at_points(robot: HybridRobot) -> HybridRobot:
    """Return a plane robot with its hinges as points: the plane keeps their axes parallel. Others stay."""
    if not planar(robot):
        return robot
    closures = tuple(
        replace(one, kind=str(JointKind.SPHERICAL), rotation="free")
        if (one.translations, one.rotation) == ((0, 1, 2), "parallel")
        else one
        for one in robot.description.closures
    )
    if closures == robot.description.closures:
        return robot
    return rebuilt(robot, replace(robot.description, closures=closures))


def planar(robot: HybridRobot) -> bool:
    """Tell whether every joint is a hinge and all axes at home are parallel."""
    if not all(kind.hinge for kind in robot.kinds):
        return False
    data = robot.unchanged_model.createData()
    pin.computeJointJacobians(robot.unchanged_model, data, robot.home)
    axes = data.J[3:].T
    return bool(np.abs(np.cross(axes, axes[:1])).max(initial=0.0) < PARALLEL)
