"""The robot's own file as other engines may read it: expanded, without shapes and meshes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike

from lxml import etree

from ...description.reading import open_robot
from ...errors import HybridynError
from ...structure.robot import HybridRobot

#: Elements of URDF and SDF that hold shapes; engines would look for meshes in vain.
SHAPES = ("visual", "collision")
FORMATS = {"robot": "URDF", "mujoco": "MJCF", "sdf": "SDF"}


@dataclass(frozen=True)
class OwnFile:
    """A robot's file.

    Attributes:
        path: Its path, or "" for a robot that has none.
        format: "URDF", "MJCF", "SDF" or "".
        text: Its text, xacro expanded, shapes of URDF and SDF left out.
    """

    path: str = ""
    format: str = ""
    text: str = ""


def own_file(
    robot: HybridRobot,
    xacro_args: Mapping[str, object] | None = None,
    package_dirs: Sequence[str | PathLike[str]] = (),
) -> OwnFile:
    """Return the file of a robot; empty if it has none, or none of text."""
    path = robot.description.source
    if path is None:
        return OwnFile()
    try:
        root = open_robot(path, dict(xacro_args or {}), package_dirs)
    except HybridynError:  # a binary format
        return OwnFile(path)
    kind = FORMATS.get(root.tag, "")
    if kind in ("URDF", "SDF"):
        for tag in SHAPES:
            for node in list(root.xml.iter(tag)):
                above = node.getparent()
                if above is not None:
                    above.remove(node)
    return OwnFile(path, kind, etree.tostring(root.xml, encoding="unicode"))
