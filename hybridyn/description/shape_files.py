"""Read the shapes that a robot's files state, as their author wrote them, and find the files of meshes.

Meshes are not opened.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from ..errors import ModelError
from .reading import open_robot
from .records import Array
from .urdf.packages import package_folders
from .urdf.xacro import share_dirs
from .urdf.xml_node import XmlNode, origin_of

Colour = tuple[float, float, float, float]
#: Sizes of round shapes.
SIZES = {"cylinder": ("radius", "length"), "capsule": ("radius", "length"), "sphere": ("radius",)}


@dataclass(frozen=True, eq=False)
class Shape:
    """A shape of a link.

    Attributes:
        kind: "box", "cylinder", "capsule", "sphere" or "mesh"; "" for a shape that cannot be read.
        placement: The shape's frame in the link, shape (4, 4). Boxes, cylinders and capsules (along z) and
            spheres are centred on it.
        size: Of a box its three edges, of a cylinder or capsule radius and length, of a sphere the radius
            [m]; of a mesh its scale along x, y and z.
        file: Address of a mesh (`package://...`) as its author wrote it; "" for other kinds.
        path: The mesh on this machine, or None if it was not looked for or not found.
        colour: Red, green, blue and opacity from 0 to 1, or None.
        role: "visual" or "collision".
        line: Line in the file, or None; of a shape that cannot be read, that of the wrong element.
        wrong: Why the shape cannot be read; "" for other shapes.
    """

    link: str
    kind: str
    placement: Array
    size: tuple[float, ...]
    file: str = ""
    path: Path | None = None
    colour: Colour | None = None
    role: str = "visual"
    line: int | None = None
    wrong: str = ""


def shapes_of(root: XmlNode, *roles: str) -> Iterator[Shape]:
    """Yield the shapes of every link that have one of these roles, in file order.

    Args:
        root: Root element of a URDF.
        roles: "visual", "collision".
    """
    colours = {node.attrib.get("name", ""): _stated(node) for node in root.children("material")}
    for link in root.children("link"):
        name = link.attrib.get("name", "").strip()
        for node in link.children(*roles):
            try:
                yield _shape(name, node, colours)
            except ModelError as error:
                yield Shape(name, "", np.eye(4), (), role=node.tag, line=error.line, wrong=error.message)


def _shape(link: str, shape: XmlNode, colours: Mapping[str, Colour | None]) -> Shape:
    placement, colour = origin_of(shape.child("origin")), None
    for material in shape.children("material")[:1]:  # a second one makes no other shape
        colour = _stated(material) or colours.get(material.attrib.get("name", ""))
    geometry = shape.required_child("geometry").children()
    for node in geometry:
        if node.tag == "mesh":
            size = node.numbers("scale", 3, (1, 1, 1))
        elif node.tag == "box":
            size = node.numbers("size", 3)
        elif node.tag in SIZES:
            size = np.array([node.number(name) for name in SIZES[node.tag]])
        else:
            continue
        file = node.text("filename") if node.tag == "mesh" else ""
        numbers = tuple(float(x) for x in size)
        return Shape(link, node.tag, placement, numbers, file, None, colour, shape.tag, shape.line)
    if geometry:
        raise geometry[0].error("not read as a shape; write a box, cylinder, capsule, sphere or mesh")
    raise shape.error("a shape without geometry")


def _stated(material: XmlNode) -> Colour | None:
    """Return the colour that a material states, or None if there is none that can be read."""
    try:
        node = material.required_child("color")
        red, green, blue, opacity = np.clip(node.numbers("rgba", 4), 0, 1).tolist()
    except ModelError:
        return None
    return red, green, blue, opacity


def urdf_root(
    file: str, xacro_args: Mapping[str, object], package_dirs: Sequence[str | os.PathLike[str]]
) -> Any:
    """Read a URDF or xacro file.

    Returns:
        The lxml element of the robot, or None for a file of another format.
    """
    root = open_robot(file, xacro_args, package_dirs)
    return root.xml if root.tag == "robot" else None


class MissingMeshError(Exception):
    """A shape cannot be loaded."""


class MeshFiles:
    """Finds the files of meshes."""

    def __init__(
        self, folder: Path, package_dirs: Sequence[str | os.PathLike[str]], *, named: bool = False
    ) -> None:
        """Find the folders; with `named`, a package's own folder has its name."""
        self.folder, self.named, self._known = folder, named, dict[str, list[str]]()
        ros = filter(None, os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep))
        shares = [Path(place) for place in (*ros, *share_dirs())]
        examples = [place / "example-robot-data" / "robots" for place in shares]
        above = [folder.resolve(), *folder.resolve().parents][:5]
        self.roots = [*(Path(place) for place in package_dirs), *shares, *examples, *above]

    def __call__(self, name: str) -> Path:
        """Find the file of a mesh.

        Args:
            name: A path, or a `package://`, `model://` or `file://` address.

        Raises:
            MissingMeshError: There is no such file.
        """
        name = unquote(name)
        scheme, _, inside = name.rpartition("://")
        if scheme in ("package", "model"):
            inside = inside.lstrip("/")  # Gepetto writes package:///NAME
            package, _, rest = inside.partition("/")
            places = [Path(folder) / rest for folder in self._packages(package)]
            if not self.named:  # a root may hold its files without the package's name
                places += [root / rest for root in self.roots]
        else:
            places = [self.folder / name.removeprefix("file://")]
        if found := next((place for place in places if place.is_file()), None):
            return found
        raise MissingMeshError(f"no file '{name}'")

    def _packages(self, package: str) -> list[str]:
        """Return the folders that may be a package, the likeliest first; each is searched for once."""
        if package not in self._known:
            self._known[package] = [*package_folders(package, [os.path.abspath(root) for root in self.roots])]
        return self._known[package]
