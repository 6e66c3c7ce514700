"""Shapes of a robot's links: their bounding boxes, and findings on shapes and meshes that cannot be read.

Each shape keeps the line of its element. trimesh (the extra `view`) loads the mesh files. It is imported only
if the robot's file names a mesh.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...description.shape_files import MeshFiles, MissingMeshError, shapes_of
from ...description.shape_files import Shape as Stated
from ...description.urdf.xml_node import Node
from ...errors import install_advice
from ...spatial import Array
from .finding import Finding

if TYPE_CHECKING:
    from .subject import Subject

#: Mesh files larger than this are not loaded [bytes].
LARGEST_MESH = 100 * 2**20
#: A mesh that is larger than its robot by this factor has another unit.
MESH = 50.0
#: `Shape.wrong` of a mesh whose file exists but was not read, because trimesh is not installed.
UNREAD = "unread"


@dataclass(frozen=True, eq=False)
class Shape:
    """One visual or collision shape of a link.

    Attributes:
        kind: "box", "cylinder", "capsule", "sphere" or "mesh"; "" for a shape that cannot be read.
        role: "visual" or "collision".
        line: Line in the file, or None.
        corners: Corners of its bounding box, shape (8, 3), [m], link frame; None if it cannot be read, or its
            mesh was not loaded.
        mesh: File name of the mesh as the robot's file states it, or None.
        wrong: Why the shape cannot be read or its mesh was not loaded, or None; of a mesh "missing",
            `UNREAD`, or the reader's message.
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
    """Read the shapes of every link.

    Args:
        root: Root element of a URDF.
        package_dirs: Folders in which `package://` searches.
        meshes: Whether mesh files are loaded.
    """
    load = _MeshBoxes(root.file, package_dirs) if meshes else None
    out: dict[str, list[Shape]] = {}
    for shape in shapes_of(root, "visual", "collision"):
        out.setdefault(shape.link, []).append(_boxed(shape, load))
    return out


def _boxed(shape: Stated, load: _MeshBoxes | None) -> Shape:
    """Return a shape with its bounding box."""
    if not shape.kind:
        return Shape("", shape.role, shape.line, None, wrong=shape.wrong)
    if shape.kind == "mesh":
        found = None if load is None else load(shape.file)
        if found is None or isinstance(found, str):
            return Shape(shape.kind, shape.role, shape.line, None, shape.file, found)
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
    return Shape(shape.kind, shape.role, shape.line, corners, shape.file or None)


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


def check_shapes(subject: Subject) -> Iterator[Finding]:
    """Check that the shapes can be read, and that their mesh files exist and can be read."""
    yield from _broken_shapes(subject)
    yield from _giant_meshes(subject)
    reported: set[str] = set()
    unread = 0
    for link, shapes in subject.shapes.items():
        for shape in shapes:
            if shape.wrong is None or shape.mesh is None or shape.mesh in reported:
                continue
            reported.add(shape.mesh)
            if shape.wrong == UNREAD:
                unread += 1
                continue
            missing = shape.wrong == "missing"
            uses = sum(other.mesh == shape.mesh for group in subject.shapes.values() for other in group)
            again = f" (used {uses} times)" if uses > 1 else ""
            yield subject.of_link(
                "missing-mesh" if missing else "broken-mesh",
                link,
                f"mesh '{shape.mesh}' {'is missing' if missing else shape.wrong}{again}",
                "the link is not drawn, and its mass cannot be compared with its shape",
                "add the file, or name the folder of its package with --package-dir"
                if missing
                else "export it again as STL, DAE or OBJ",
                shape.line,
            )
    if unread:
        yield Finding(
            "unread-meshes",
            "",
            f"{unread} mesh file{'s were' if unread > 1 else ' was'} not read: trimesh is not installed",
            "masses, inertias and units cannot be compared with these shapes",
            install_advice("view"),
            subject.description.source,
        )


def _broken_shapes(subject: Subject) -> Iterator[Finding]:
    """Find shapes that cannot be read; those that one macro writes are one finding."""
    reported: set[tuple[str, str]] = set()
    for link, shapes in subject.shapes.items():
        for shape in shapes:
            if shape.kind or shape.wrong is None:
                continue
            finding = subject.of_link(
                "broken-shape",
                link,
                f"its {shape.role} shape cannot be read: {shape.wrong}",
                "it is not drawn or converted, and the link's mass cannot be compared with it",
                "correct the element that the message names, or remove the shape",
                shape.line,
            )
            if (finding.message, finding.place) not in reported:
                reported.add((finding.message, finding.place))
                yield finding


def _giant_meshes(subject: Subject) -> Iterator[Finding]:
    size = subject.extent
    reported: set[str] = set()
    for link, shapes in subject.shapes.items():
        for shape in shapes:
            if shape.mesh is None or shape.corners is None or shape.mesh in reported or not size:
                continue
            own = float(np.linalg.norm(np.ptp(shape.corners, axis=0)))
            if not own or own <= MESH * size:
                continue
            reported.add(shape.mesh)
            yield subject.of_link(
                "mesh-scale",
                link,
                f"mesh '{shape.mesh}' spans {own:.3g} m in a robot of {size:.3g} m",
                "drawings, and checks that use shapes, are meaningless",
                'meshes in millimetres need <mesh scale="0.001 0.001 0.001">',
                shape.line,
            )
