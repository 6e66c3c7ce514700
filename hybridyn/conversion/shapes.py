"""The visual shapes of a robot that is written in another format."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from ..description.records import Description
from ..description.shape_files import MeshFiles, MissingMeshError, Shape, shapes_of, urdf_root
from ..description.urdf.xml_node import XmlNode
from ..errors import ModelError
from .request import Losses

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
        root = XmlNode(urdf_root(d.source, xacro_args, package_dirs), d.source)
    except ModelError:
        losses.add("visual shapes: the file needs arguments that are not given")
        return ()
    find = MeshFiles(Path(d.source).parent, package_dirs)
    links, out = {link.name for link in d.links}, []
    for shape in shapes_of(root, "visual"):
        if shape.kind in ("", "capsule"):
            losses.add("visual shapes that cannot be read", shape.link)
        elif shape.link in links:
            path = None
            with contextlib.suppress(MissingMeshError):
                path = find(shape.file) if shape.file else None
            out.append(replace(shape, path=path, file=_reference(shape.file, path, target)))
    return tuple(out)


def _reference(file: str, path: Path | None, target: Path) -> str:
    """Return how a file refers to a mesh: the author's address, or the path from the file's own folder."""
    if path is None or file.startswith(("package://", "model://")):
        return file
    return os.path.relpath(path.resolve(), target.resolve().parent)
