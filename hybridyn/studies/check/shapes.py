"""Shapes of a robot's links: their bounding boxes, and findings on shapes and meshes that cannot be read.

Each shape keeps the line of its element. trimesh (the extra `view`) loads the mesh files. It is imported only
if the robot's file names a mesh.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache, partial
from itertools import product
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...description.names import counted
from ...description.shape_files import MeshFiles, MissingMeshError, Shape, shapes_of
from ...description.urdf.xml_node import XmlNode
from ...errors import install_advice
from ...spatial import Array
from .finding import Finding

if TYPE_CHECKING:
    from .subject import Subject

#: Mesh files larger than this are not loaded [bytes].
LARGEST_MESH = 100 * 2**20
#: A mesh that is larger than its robot by this factor has another unit.
MESH = 50.0
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


def check_shapes(subject: Subject) -> Iterator[Finding]:
    """Check that shapes and meshes can be read, and that meshes have the robot's unit; each mesh once."""
    known, unread = set[object](), set[str]()
    for link, shape in ((link, shape) for link, shapes in subject.shapes.items() for shape in shapes):
        if shape.mesh is None and shape.wrong is not None:
            finding = subject.of_link(
                "broken-shape",
                link,
                f"its {shape.role} shape cannot be read: {shape.wrong}",
                "it is not drawn or converted, and the link's mass cannot be compared with it",
                "correct the element that the message names, or remove the shape",
                shape.line,
            )
            if (said := (finding.message, finding.place)) not in known:  # one macro writes many
                known.add(said)
                yield finding
        elif shape.mesh is not None and shape.mesh not in known:
            known.add(shape.mesh)
            unread |= {shape.mesh} if shape.wrong == UNREAD else set()
            yield from _mesh(subject, link, shape, shape.mesh)
    if unread:
        yield Finding(
            "unread-meshes",
            "",
            f"{counted(len(unread), 'mesh file')} not read: trimesh is not installed",
            "masses, inertias and units cannot be compared with these shapes",
            install_advice("view"),
            subject.description.source,
        )


def _mesh(subject: Subject, link: str, shape: LinkShape, mesh: str) -> Iterator[Finding]:
    """Check a mesh of a link."""
    unseen = "the link is not drawn, and its mass cannot be compared with its shape"
    if shape.wrong == "missing":
        mend = "add the file, or name the folder of its package with --package-dir"
        yield subject.of_link("missing-mesh", link, f"mesh '{mesh}' is missing", unseen, mend, shape.line)
    elif shape.wrong not in (None, UNREAD):
        mend = "export it again as STL, DAE or OBJ"
        yield subject.of_link("broken-mesh", link, f"mesh '{mesh}' {shape.wrong}", unseen, mend, shape.line)
    elif shape.corners is not None:
        own = float(np.linalg.norm(np.ptp(shape.corners, axis=0)))
        if own > MESH * subject.extent > 0:
            yield subject.of_link(
                "mesh-scale",
                link,
                f"mesh '{mesh}' spans {own:.3g} m in a robot of {subject.extent:.3g} m",
                "drawings, and checks that use shapes, are meaningless",
                'meshes in millimetres need <mesh scale="0.001 0.001 0.001">',
                shape.line,
            )
