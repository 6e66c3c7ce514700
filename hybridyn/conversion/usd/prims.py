"""Prims of a USD text: schemas, attributes, relationships, children; rigid bodies with masses and shapes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from ...description.names import unique
from ...description.records import Array, Link
from ...description.shape_files import Shape
from ..numerals import numeral, principal, quaternion_of
from ..request import Losses


class Prim:
    """A prim.

    Args:
        kind: Its type, "" for none.
        name: Its name, valid as an identifier.
        path: Its path.
    """

    def __init__(self, kind: str, name: str, path: str) -> None:
        self.kind, self.name, self.path = kind, name, path
        self.schemas: dict[str, None] = {}
        self._lines: list[str] = []
        self.children: list[Prim] = []
        self._taken: set[str] = set()

    def child(self, kind: str, name: str) -> Prim:
        """Add a prim below, whose name gets a number where another one has it."""
        name = unique(name, self._taken)
        out = Prim(kind, name, f"{self.path}/{name}")
        self.children.append(out)
        return out

    def apply(self, schema: str) -> None:
        """Apply a schema, once."""
        self.schemas[schema] = None

    def line(self, text: str) -> None:
        """Add an attribute or relationship as text."""
        self._lines.append(text)

    def numbers(self, kind: str, name: str, values: float | Sequence[float] | Array) -> None:
        """Add an attribute of numbers."""
        self.line(f"{kind} {name} = {_tuple(np.ravel(values))}")

    def place(self, placement: Array, scale: Sequence[float] = ()) -> None:
        """Add the transform of the prim in its parent, and factors along its axes."""
        order = []
        if not np.array_equal(placement, np.eye(4)):
            self.line(f"double3 xformOp:translate = {_tuple(placement[:3, 3])}")
            self.line(f"quatd xformOp:orient = {_tuple(quaternion_of(placement[:3, :3]))}")
            order = ["xformOp:translate", "xformOp:orient"]
        if scale:
            self.line(f"double3 xformOp:scale = {_tuple(scale)}")
            order.append("xformOp:scale")
        if order:
            words = ", ".join(f'"{word}"' for word in order)
            self.line(f"uniform token[] xformOpOrder = [{words}]")

    def lines(self, indent: str = "") -> Iterable[str]:
        """Yield the lines of the prim and of those below."""
        kind = f"{self.kind} " if self.kind else ""
        applied = ", ".join(f'"{schema}"' for schema in self.schemas)
        yield f'{indent}def {kind}"{self.name}"' + (
            f" (\n{indent}    prepend apiSchemas = [{applied}]\n{indent})" if applied else ""
        )
        yield indent + "{"
        for line in self._lines:
            yield f"{indent}    {line}"
        for child in self.children:
            yield ""
            yield from child.lines(indent + "    ")
        yield indent + "}"


def _tuple(numbers: Iterable[float]) -> str:
    parts = [numeral(number) for number in numbers]
    return parts[0] if len(parts) == 1 else f"({', '.join(parts)})"


def add_body(parent: Prim, link: Link, placement: Array) -> Prim:
    """Add a rigid body at a placement in the world, shape (4, 4); a mass has an inertia there."""
    body = parent.child("Xform", link.name)
    body.apply("PhysicsRigidBodyAPI")
    body.apply("PhysicsMassAPI")
    body.place(placement)
    if not link.mass and not link.inertia.any():
        return body
    body.numbers("float", "physics:mass", link.mass)
    body.numbers("point3f", "physics:centerOfMass", link.com)
    moments, axes = principal(link.inertia)
    body.numbers("float3", "physics:diagonalInertia", moments)
    if not np.array_equal(axes, np.eye(3)):
        body.numbers("quatf", "physics:principalAxes", quaternion_of(axes))
    return body


def add_shape(body: Prim, shape: Shape, losses: Losses) -> None:
    """Add a visual shape.

    Args:
        body: The prim of its link.
        losses: Receives meshes, which are not written.
    """
    if shape.kind == "mesh":
        losses.add("meshes of links are not written", shape.link)
        return
    out = body.child(shape.kind.replace("box", "cube").capitalize(), "visual")
    if shape.kind == "box":
        out.place(shape.placement, shape.size)
        out.line("double size = 1")
    else:
        out.place(shape.placement)
        for word, size in zip(("radius", "height"), shape.size, strict=False):
            out.numbers("double", word, size)
    if shape.colour is not None:
        *colour, opacity = shape.colour
        out.line(f"color3f[] primvars:displayColor = [{_tuple(colour)}]")
        out.line(f"float[] primvars:displayOpacity = [{numeral(opacity)}]")
