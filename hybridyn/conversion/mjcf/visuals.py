"""Write visual shapes as geoms that touch nothing and weigh nothing."""

from __future__ import annotations

import os
from pathlib import Path
from xml.etree import ElementTree as ET

from ...description.urdf.shapes import Shape
from ..numerals import add, put
from ..request import Losses, Request
from .bodies import Tree, pose

#: Endings of the meshes that MuJoCo reads.
MESHES = (".stl", ".obj", ".msh")
#: Most triangles of an STL file that MuJoCo reads.
MOST_FACES = 200_000


def add_visuals(root: ET.Element, request: Request, tree: Tree, losses: Losses) -> None:
    """Add the shapes of a robot.

    Args:
        root: The root element, which receives `<asset>`.
        losses: Receives the shapes that MuJoCo cannot read.
    """
    assets: dict[tuple[str, tuple[float, ...]], str] = {}
    for shape in request.shapes:
        body = tree.bodies.get(shape.link)
        if body is None:
            losses.add("visual shapes of massless links that have no body", shape.link)
        elif shape.kind != "mesh" and any(size <= 0 for size in shape.size):
            losses.add("visual shapes without extent", shape.link)
        elif shape.kind != "mesh" or _is_readable(shape, losses):
            geom = add(body, "geom", type=shape.kind, group="2", contype="0", conaffinity="0", mass="0")
            if shape.kind == "mesh":
                assert shape.path is not None
                file = os.path.relpath(shape.path.resolve(), request.target.resolve().parent)
                name = f"{shape.path.stem}_{len(assets)}"
                put(geom, mesh=assets.setdefault((file, shape.size), name))
            else:
                first, *others = shape.size  # of a box all edges, else the radius and perhaps a length
                put(
                    geom, size=(first / 2 if shape.kind == "box" else first, *(other / 2 for other in others))
                )
            put(geom, rgba=shape.colour, **pose(shape.placement))
    asset = add(root, "asset") if assets else root
    for (file, scale), name in assets.items():
        factors = scale if any(factor != 1 for factor in scale) else None
        add(asset, "mesh", name=name, file=file, inertia="shell", scale=factors)


def _is_readable(shape: Shape, losses: Losses) -> bool:
    """Say whether MuJoCo reads a mesh, as far as its ending and the head of an STL file tell."""
    if shape.path is None:
        losses.add("meshes that were not found", shape.file)
        return False
    ending = shape.path.suffix.lower()
    readable = ending in MESHES and (ending != ".stl" or _is_binary(shape.path))
    if not readable:
        losses.add(
            f"meshes that MuJoCo does not read (it takes {', '.join(MESHES)}; STL in binary)", shape.file
        )
    return readable


def _is_binary(file: Path) -> bool:
    """Say whether an STL file is a binary one that MuJoCo reads."""
    with open(file, "rb") as content:
        head = content.read(84)
    faces = int.from_bytes(head[80:84], "little")
    return 0 < faces <= MOST_FACES and file.stat().st_size == 84 + 50 * faces
