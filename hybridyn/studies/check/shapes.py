"""Read the shapes of a robot's links: their bounding boxes, and meshes that are missing or broken.

Each shape keeps the line of its element. trimesh (the extra `view`) loads the mesh files. It is imported only
if the robot's file names a mesh.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from os import PathLike
from pathlib import Path

import numpy as np

from ...description.shape_files import MeshFiles, MissingMeshError
from ...description.urdf.placement import origin_of
from ...description.urdf.xml_node import Node
from ...errors import ModelError
from ...spatial import Array

#: Mesh files larger than this are not loaded [bytes].
LARGEST_MESH = 100 * 2**20
#: `Shape.wrong` of a mesh whose file exists but was not read, because trimesh is not installed.
UNREAD = "unread"


@dataclass(frozen=True)
class Shape:
    """One visual or collision shape of a link.

    Attributes:
        kind: "box", "cylinder", "capsule", "sphere" or "mesh".
        role: "visual" or "collision".
        line: Line in the file, or None.
        corners: Corners of its bounding box, shape (8, 3), [m], link frame; None if its mesh was not loaded.
        mesh: File name of the mesh as the robot's file states it, or None.
        wrong: Why the mesh was not loaded, or None: "missing", `UNREAD`, or the reader's message.
    """

    kind: str
    role: str
    line: int | None
    corners: Array | None
    mesh: str | None = None
    wrong: str | None = None


def read_shapes(
    root: Node, package_dirs: Sequence[str | PathLike[str]], *, meshes: bool = True
) -> dict[str, list[Shape]]:
    """Read the shapes of every link. Shapes that cannot be interpreted are omitted.

    Args:
        root: Root element of a URDF.
        package_dirs: Folders in which `package://` searches.
        meshes: Whether mesh files are loaded.
    """
    load = _MeshBoxes(root.file.removesuffix(" (expanded)"), package_dirs) if meshes else None
    out: dict[str, list[Shape]] = {}
    for link in root.children("link"):
        for node in link.children("visual", "collision"):
            try:
                shape = _shape(node, load)
            except ModelError:
                continue
            if shape is not None:
                out.setdefault(link.text("name"), []).append(shape)
    return out


def _shape(node: Node, load: _MeshBoxes | None) -> Shape | None:
    geometry = node.child("geometry")
    inner = geometry.children()[:1] if geometry is not None else []
    if not inner:
        return None
    shape, mesh, wrong = inner[0], None, None
    if shape.tag == "box":
        half = np.abs(shape.numbers("size", 3)) / 2
        lower, upper = -half, half
    elif shape.tag in ("cylinder", "capsule"):
        r, length = abs(shape.number("radius")), abs(shape.number("length"))
        upper = np.array([r, r, length / 2 + (r if shape.tag == "capsule" else 0.0)])
        lower = -upper
    elif shape.tag == "sphere":
        upper = np.full(3, abs(shape.number("radius")))
        lower = -upper
    elif shape.tag == "mesh":
        mesh = shape.text("filename")
        if load is None:
            return Shape("mesh", node.tag, node.line, None, mesh)
        found = load(mesh)
        if isinstance(found, str):
            return Shape("mesh", node.tag, node.line, None, mesh, found)
        scale = shape.numbers("scale", 3, (1.0, 1.0, 1.0))
        lower, upper = np.sort(np.array(found) * scale, axis=0)
    else:
        return None
    corners = np.array(list(product(*zip(lower, upper, strict=True))))
    placement = origin_of(node.child("origin"))
    corners = corners @ placement[:3, :3].T + placement[:3, 3]
    return Shape(shape.tag, node.tag, node.line, corners, mesh, wrong)


class _MeshBoxes:
    """Computes bounding boxes of meshes, and loads each file once."""

    def __init__(self, file: str, package_dirs: Sequence[str | PathLike[str]]) -> None:
        self.find = MeshFiles(Path(file).parent, package_dirs, named=True)
        self.known: dict[str, tuple[Array, Array] | str] = {}

    def __call__(self, name: str) -> tuple[Array, Array] | str:
        """Return lower and upper corner of a mesh in its own units, or the reason why it has none."""
        if name not in self.known:
            self.known[name] = self._load(name)
        return self.known[name]

    def _load(self, name: str) -> tuple[Array, Array] | str:
        try:
            file = self.find(name)
        except MissingMeshError:
            return "missing"
        if file.stat().st_size > LARGEST_MESH:
            return f"is larger than {LARGEST_MESH // 2**20} MiB"
        import warnings

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
