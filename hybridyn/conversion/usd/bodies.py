"""Links as rigid bodies: transform, mass properties, shapes."""

from __future__ import annotations

import numpy as np

from ...description.records import Array, Link
from ...description.urdf.shapes import Shape
from ..numerals import numeral, principal, quaternion_of
from ..request import Losses
from .prims import Prim


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
    out = body.child({"box": "Cube", "cylinder": "Cylinder", "sphere": "Sphere"}[shape.kind], "visual")
    out.place(shape.placement, shape.size if shape.kind == "box" else ())
    if shape.kind == "box":
        out.line("double size = 1")
    else:
        out.line(f"double radius = {numeral(shape.size[0])}")
    if shape.kind == "cylinder":
        out.line(f"double height = {numeral(shape.size[1])}")
    if shape.colour is not None:
        red, green, blue, opacity = (numeral(part) for part in shape.colour)
        out.line(f"color3f[] primvars:displayColor = [({red}, {green}, {blue})]")
        out.line(f"float[] primvars:displayOpacity = [{opacity}]")
