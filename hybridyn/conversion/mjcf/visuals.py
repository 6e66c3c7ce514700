"""Write visual shapes as geoms that touch nothing and weigh nothing."""

from __future__ import annotations

import os
from pathlib import Path
from xml.etree import ElementTree as ET

from ...description.urdf.shapes import Shape
from ..numerals import numerals
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
            continue
        attributes = {"type": shape.kind, "group": "2", "contype": "0", "conaffinity": "0", "mass": "0"}
        if shape.kind == "mesh":
            if not (name := _asset(assets, shape, request, losses)):
                continue
            attributes["mesh"] = name
        elif any(size <= 0 for size in shape.size):
            losses.add("visual shapes without extent", shape.link)
            continue
        else:
            attributes["size"] = numerals(_size(shape))
        if shape.colour is not None:
            attributes["rgba"] = numerals(shape.colour)
        ET.SubElement(body, "geom", attributes | pose(shape.placement))
    if assets:
        asset = ET.SubElement(root, "asset")
        for (file, scale), name in assets.items():
            element = ET.SubElement(asset, "mesh", name=name, file=file, inertia="shell")
            if any(factor != 1 for factor in scale):
                element.set("scale", numerals(scale))


def _size(shape: Shape) -> tuple[float, ...]:
    """Return MuJoCo's sizes: half edges, radius and half length."""
    if shape.kind == "box":
        return tuple(edge / 2 for edge in shape.size)
    return (shape.size[0], *(length / 2 for length in shape.size[1:]))


def _asset(
    assets: dict[tuple[str, tuple[float, ...]], str], shape: Shape, request: Request, losses: Losses
) -> str:
    """Return the name of a mesh, "" if MuJoCo cannot read it."""
    if shape.path is None:
        losses.add("meshes that were not found", shape.file)
        return ""
    if not _is_readable(shape.path):
        losses.add(
            f"meshes that MuJoCo does not read (it takes {', '.join(MESHES)}; STL in binary)", shape.file
        )
        return ""
    file = os.path.relpath(shape.path.resolve(), request.target.resolve().parent)
    return assets.setdefault((file, shape.size), f"{shape.path.stem}_{len(assets)}")


def _is_readable(file: Path) -> bool:
    """Say whether MuJoCo reads a mesh, as far as its ending and the head of an STL file tell."""
    ending = file.suffix.lower()
    if ending != ".stl":
        return ending in MESHES
    with open(file, "rb") as content:
        head = content.read(84)
    faces = int.from_bytes(head[80:84], "little")
    return 0 < faces <= MOST_FACES and file.stat().st_size == 84 + 50 * faces
