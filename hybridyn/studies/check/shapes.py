"""Shapes of a robot's links: their bounding boxes, and findings on shapes and meshes that cannot be read.

Each shape keeps the line of its element. trimesh (the extra `view`) loads the mesh files. It is imported only
if the robot's file names a mesh.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, partial
from itertools import product
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...description.shape_files import MeshFiles, MissingMeshError, Shape, shapes_of
from ...description.urdf.xml_node import XmlNode
from ...spatial import Array

if TYPE_CHECKING:
    pass

#: Mesh files larger than this are not loaded [bytes].
LARGEST_MESH = 100 * 2**20
#: `LinkShape.wrong` of a mesh whose file exists but was not read, because trimesh is not installed.
UNREAD = "unread"

#: Lower and upper corner, shape (3,) each.
Bounds = tuple[Array, Array]


@dataclass(frozen=True, eq=False)
class LinkShape:
    """One visual or collision shape of a link.

    Attributes:
        role: "visual" or "collision".
        line: Line in the file, or None.
        corners: Corners of its bounding box, shape (8, 3), [m], link frame; None if it cannot be read, or its
            mesh was not loaded.
        mesh: File name of the mesh as the robot's file states it, or None.
        wrong: Why the shape cannot be read or its mesh was not loaded, or None; of a mesh "missing",
            `UNREAD`, or the reader's message.
    """

    role: str
    line: int | None
    corners: Array | None
    mesh: str | None = None
    wrong: str | None = None


def read_shapes(
    root: XmlNode, package_dirs: Sequence[str | PathLike[str]], *, meshes: bool = True
) -> dict[str, list[LinkShape]]:
    """Read the shapes of every link.

    Args:
        root: Root element of a URDF.
        package_dirs: Folders in which `package://` searches.
        meshes: Whether mesh files are loaded.
    """
    find = MeshFiles(Path(root.file).parent, package_dirs, named=True)
    load = cache(partial(_bounds, find)) if meshes else lambda name: None
    out: dict[str, list[LinkShape]] = {}
    for shape in shapes_of(root, "visual", "collision"):
        out.setdefault(shape.link, []).append(_boxed(shape, load))
    return out


def _boxed(shape: Shape, load: Callable[[str], Bounds | str | None]) -> LinkShape:
    """Return a shape with its bounding box."""
    if not shape.kind:
        return LinkShape(shape.role, shape.line, None, wrong=shape.wrong)
    if shape.kind == "mesh":
        found = load(shape.file)
        if found is None or isinstance(found, str):
            return LinkShape(shape.role, shape.line, None, shape.file, found)
        lower, upper = np.sort(np.array(found) * shape.size, axis=0)
    else:
        radius, *length = np.abs(shape.size)
        if shape.kind == "box":
            upper = np.abs(shape.size) / 2
        elif shape.kind == "sphere":
            upper = np.full(3, radius)
        else:
            upper = np.array([radius, radius, length[0] / 2 + (radius if shape.kind == "capsule" else 0.0)])
        lower = -upper
    corners = np.array(list(product(*zip(lower, upper, strict=True))))
    corners = corners @ shape.placement[:3, :3].T + shape.placement[:3, 3]
    return LinkShape(shape.role, shape.line, corners, shape.file or None)


def _bounds(find: MeshFiles, name: str) -> Bounds | str:
    """Return lower and upper corner of a mesh in its own units, or the reason why it has none."""
    try:
        file = find(name)
    except MissingMeshError:
        return "missing"
    if file.stat().st_size > LARGEST_MESH:
        return f"is larger than {LARGEST_MESH // 2**20} MiB"
    try:
        import trimesh
    except ImportError:
        return UNREAD
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            bounds = trimesh.load(file, force="mesh").bounds
    except Exception as error:  # about twenty formats: on any error the mesh is broken
        return f"cannot be read ({type(error).__name__}: {' '.join(str(error).split())[:100]})"
    if bounds is None or not np.isfinite(bounds).all():
        return "has no triangles"
    return np.asarray(bounds[0], dtype=float), np.asarray(bounds[1], dtype=float)
