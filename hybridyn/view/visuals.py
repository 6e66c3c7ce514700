"""Read the visual shapes of a URDF (boxes, cylinders, spheres, meshes) with yourdfpy and trimesh.

yourdfpy only parses the file; trimesh loads the meshes. A missing or broken mesh is reported in a note. Its
link is then drawn in primitive shapes if it has no other shape.
"""

from __future__ import annotations

import io
import os
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..description.shape_files import MeshFiles, MissingMeshError, urdf_root
from ..spatial import Array, Index

#: Sides of a cylinder.
ROUND = 24
#: Largest number of triangles of a mesh; a screen cannot show more.
LARGEST_MESH = 200_000
#: Colour of a shape without a colour in its file.
UNSTATED = "#b9bfc6"
#: Number of missing shapes that are listed by name.
NAMED = 4


@dataclass(frozen=True, eq=False)
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
    import yourdfpy
    from lxml import etree

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it warns of closures, which it does not know
        robot = yourdfpy.URDF.load(
            io.BytesIO(etree.tostring(root)), build_scene_graph=False, load_meshes=False
        ).robot
    colours = {m.name: _colour(m.color) for m in robot.materials if m.color is not None}
    find = MeshFiles(Path(file).parent, package_dirs)
    found, missing = [], []
    for link in robot.links:
        for visual in link.visuals:
            try:
                mesh = _mesh(visual.geometry, find)
            except MissingMeshError as error:
                missing.append(str(error))
                continue
            placement = np.eye(4) if visual.origin is None else visual.origin
            vertices = np.asarray(mesh.vertices) @ placement[:3, :3].T + placement[:3, 3]
            colour = _own_colour(visual.material, colours) or _mesh_colour(mesh) or UNSTATED
            found.append(Visual(link.name, vertices, np.asarray(mesh.faces), colour))
    return found, _notes([*dict.fromkeys(missing)])


def _notes(missing: list[str]) -> list[str]:
    """Return the note on shapes that are missing, if any."""
    more = f" and {len(missing) - NAMED} more" if len(missing) > NAMED else ""
    return [f"shapes not drawn: {', '.join(missing[:NAMED])}{more}"] if missing else []


def _mesh(geometry: Any, find: MeshFiles) -> Any:
    """Build the triangles of a shape."""
    import trimesh

    if geometry.box is not None:
        return trimesh.creation.box(extents=geometry.box.size)
    if geometry.cylinder is not None:
        c = geometry.cylinder
        return trimesh.creation.cylinder(radius=c.radius, height=c.length, sections=ROUND)
    if geometry.sphere is not None:
        return trimesh.creation.icosphere(subdivisions=2, radius=geometry.sphere.radius)
    if geometry.mesh is None:
        raise MissingMeshError("a shape without geometry")
    file = find(geometry.mesh.filename)
    try:
        mesh: Any = trimesh.load(file, force="mesh")
    except Exception as error:  # about twenty formats: on any error the shape is missing
        raise MissingMeshError(f"'{file}' ({type(error).__name__})") from error
    faces = getattr(mesh, "faces", ())
    if not len(faces) or len(faces) > LARGEST_MESH or not np.isfinite(mesh.vertices).all():
        raise MissingMeshError(f"'{file}' ({len(faces):,} triangles)")
    scale = geometry.mesh.scale
    if scale is not None:
        mesh.apply_scale(scale)
    return mesh


def _own_colour(material: Any, named: Mapping[str, str]) -> str | None:
    """Return the colour of a shape's material, or None if the material is missing or has no colour."""
    if material is None:
        return None
    return _colour(material.color) if material.color is not None else named.get(material.name)


def _colour(color: Any) -> str:
    """Return a URDF colour as "#rrggbb"."""
    rgba = np.clip(np.nan_to_num(np.asarray(color.rgba, dtype=float)), 0, 1)
    return "#" + "".join(f"{round(255 * x):02x}" for x in rgba[:3])


def _mesh_colour(mesh: Any) -> str | None:
    """Return the colour that a mesh file gives to the whole mesh, or None."""
    color = getattr(getattr(mesh.visual, "material", None), "main_color", None)
    return None if color is None else "#" + "".join(f"{int(x):02x}" for x in color[:3])
