"""Read the visual shapes of a URDF as its author wrote them; meshes are found but not opened."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..description.records import Description
from ..description.shape_files import MeshFiles, MissingMeshError, urdf_root
from ..description.urdf.placement import origin_of
from ..description.urdf.xml_node import Node
from ..errors import ModelError
from .losses import Losses
from .request import Shape

Colour = tuple[float, float, float, float]

#: Words of files of other formats that state shapes.
SHAPES = (b"<geom", b"<visual", b"def Mesh", b"def Cube", b"def Sphere", b"def Cylinder", b"def Capsule")


def read_shapes(
    d: Description,
    target: Path,
    xacro_args: Mapping[str, object],
    package_dirs: Sequence[str | os.PathLike[str]],
    losses: Losses,
) -> tuple[Shape, ...]:
    """Read the shapes of a robot's links.

    Args:
        target: The file to be written.
        xacro_args: Arguments of a xacro file by name.
        package_dirs: Folders in which `package://` searches.
        losses: Receives shapes that cannot be read.
    """
    if d.source is None or not Path(d.source).is_file():
        return ()
    if d.format != "URDF":
        if any(word in Path(d.source).read_bytes() for word in SHAPES):
            losses.add("visual shapes, which convert reads from URDF only")
        return ()
    try:
        root = Node(urdf_root(d.source, xacro_args, package_dirs), d.source)
    except ModelError:
        losses.add("visual shapes: the file needs arguments that are not given")
        return ()
    colours = {node.xml.get("name", ""): _stated(node) for node in root.children("material")}
    find = MeshFiles(Path(d.source).parent, package_dirs)
    links, out = {link.name for link in d.links}, []
    for link in root.children("link"):
        name = str(link.xml.get("name", "")).strip()
        for visual in link.children("visual"):
            try:
                shape = _shape(name, visual, colours, find)
            except ModelError:
                losses.add("visual shapes that cannot be read", name)
                continue
            if name in links:
                out.append(replace(shape, file=_reference(shape, target)))
    return tuple(out)


def _shape(link: str, visual: Node, colours: Mapping[str, Colour | None], find: MeshFiles) -> Shape:
    """Return a shape."""
    placement = origin_of(visual.child("origin"))
    material = visual.child("material")
    colour = None
    if material is not None:
        colour = _stated(material) or colours.get(material.xml.get("name", ""))
    for node in visual.required_child("geometry").children():
        if node.tag == "box":
            return Shape(link, "box", placement, tuple(node.numbers("size", 3)), colour=colour)
        if node.tag == "cylinder":
            size = node.number("radius"), node.number("length")
            return Shape(link, "cylinder", placement, size, colour=colour)
        if node.tag == "sphere":
            return Shape(link, "sphere", placement, (node.number("radius"),), colour=colour)
        if node.tag == "mesh":
            name, scale = node.text("filename"), tuple(float(x) for x in node.numbers("scale", 3, (1, 1, 1)))
            try:
                path = find(name)
            except MissingMeshError:
                path = None
            return Shape(link, "mesh", placement, scale, name, path, colour)
    raise visual.error("a shape without geometry")


def _stated(material: Node) -> Colour | None:
    """Return the colour that a material states, or None if there is none that can be read."""
    try:
        node = material.child("color")
        numbers = None if node is None else np.clip(node.numbers("rgba", 4), 0, 1)
    except ModelError:
        return None
    if numbers is None:
        return None
    red, green, blue, opacity = (float(number) for number in numbers)
    return red, green, blue, opacity


def _reference(shape: Shape, target: Path) -> str:
    """Return how a file refers to a mesh: the author's address, or the path from the file's own folder."""
    if shape.path is None or shape.file.startswith(("package://", "model://")):
        return shape.file
    return os.path.relpath(shape.path.resolve(), target.resolve().parent)
