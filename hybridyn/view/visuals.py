"""Read the visual shapes of a URDF (boxes, cylinders, spheres, meshes) as triangles, with trimesh.

A missing or broken mesh is reported in a note. Its link is then drawn in primitive shapes if it has no other
shape.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..description.shape_files import MeshFiles, MissingMeshError, urdf_root
from ..description.urdf.shapes import Shape, shapes_of
from ..description.urdf.xml_node import Node
from ..spatial import Array, Index

#: Sides of a cylinder.
ROUND = 24
#: Largest number of triangles of a mesh; a screen cannot show more.
LARGEST_MESH = 200_000
#: Colour of a shape without a colour in its file.
UNSTATED = "#b9bfc6"
#: Number of missing shapes that are listed by name.
NAMED = 4


@dataclass(frozen=True)
class Visual:
    """One shape of a link.

    Attributes:
        vertices: Corners in the link's frame, shape (V, 3), [m].
        faces: Corners of each triangle, shape (F, 3).
        colour: The colour from its file, "#rrggbb".
    """

    link: str
    vertices: Array
    faces: Index
    colour: str


def read_visuals(
    file: str, xacro_args: Mapping[str, object], package_dirs: Sequence[str | os.PathLike[str]]
) -> tuple[list[Visual], list[str]]:
    """Read the shapes of a robot's links.

    Args:
        file: The robot's file; only URDF and xacro have shapes that are read.
        xacro_args: Arguments of a xacro file by name.
        package_dirs: Folders in which `package://` searches.

    Returns:
        The shapes, and notes on those that are missing.
    """
    root = urdf_root(file, xacro_args, package_dirs)
    if root is None or root.find(".//visual") is None:
        return [], []
    find = MeshFiles(Path(file).parent, package_dirs)
    found, missing = [], []
    for shape in shapes_of(Node(root, file), "visual"):
        try:
            mesh = _mesh(shape, find)
        except MissingMeshError as error:
            missing.append(str(error))
            continue
        vertices = np.asarray(mesh.vertices) @ shape.placement[:3, :3].T + shape.placement[:3, 3]
        found.append(Visual(shape.link, vertices, np.asarray(mesh.faces), _colour(shape, mesh)))
    unique = [*dict.fromkeys(missing)]
    more = f" and {len(unique) - NAMED} more" if len(unique) > NAMED else ""
    return found, [f"shapes not drawn: {', '.join(unique[:NAMED])}{more}"] if unique else []


def _mesh(shape: Shape, find: MeshFiles) -> Any:
    """Build the triangles of a shape."""
    import trimesh

    if shape.kind == "box":
        return trimesh.creation.box(extents=shape.size)
    if shape.kind == "cylinder":
        radius, length = shape.size
        return trimesh.creation.cylinder(radius=radius, height=length, sections=ROUND)
    if shape.kind == "sphere":
        return trimesh.creation.icosphere(subdivisions=2, radius=shape.size[0])
    if shape.kind != "mesh":
        raise MissingMeshError("a shape without geometry")
    file = find(shape.file)
    try:
        mesh: Any = trimesh.load(file, force="mesh")
    except Exception as error:  # about twenty formats: on any error the shape is missing
        raise MissingMeshError(f"'{file}' ({type(error).__name__})") from error
    faces = getattr(mesh, "faces", ())
    if not len(faces) or len(faces) > LARGEST_MESH or not np.isfinite(mesh.vertices).all():
        raise MissingMeshError(f"'{file}' ({len(faces):,} triangles)")
    mesh.apply_scale(shape.size)
    return mesh


def _colour(shape: Shape, mesh: Any) -> str:
    """Return the colour that the file gives to a shape, or its mesh file to the whole mesh: "#rrggbb"."""
    if shape.colour is not None:
        return "#" + "".join(f"{round(255 * x):02x}" for x in shape.colour[:3])
    own = getattr(getattr(mesh.visual, "material", None), "main_color", None)
    return UNSTATED if own is None else "#" + "".join(f"{int(x):02x}" for x in own[:3])
