"""The inertia of a link from its collision shapes, as `<inertial auto="true">` asks.

Each shape is solid and of one density. The inertia of the link is about its centre of mass, in its own axes.

Source: sdformat, `Link::ResolveAutoInertials`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from ..names import listed
from ..placement import inverse
from ..records import Array
from ..urdf.xml_node import XmlNode
from .elements import pose, relative_to
from .models import Item, SdfModels

#: Density of water [kg/m^3], which sdformat takes where none is stated.
WATER = 1000.0

#: Volume, centre on the z axis, and moments about the centre per mass, of a shape of these sizes.
Solid = tuple[float, float, tuple[float, float, float]]


def _box(x: float, y: float, z: float) -> Solid:
    return x * y * z, 0.0, ((y * y + z * z) / 12, (x * x + z * z) / 12, (x * x + y * y) / 12)


def _ellipsoid(a: float, b: float, c: float) -> Solid:
    moments = (b * b + c * c) / 5, (a * a + c * c) / 5, (a * a + b * b) / 5
    return 4 / 3 * math.pi * a * b * c, 0.0, moments


def _sphere(r: float) -> Solid:
    return _ellipsoid(r, r, r)


def _cylinder(r: float, length: float) -> Solid:
    across = (3 * r * r + length * length) / 12
    return math.pi * r * r * length, 0.0, (across, across, r * r / 2)


def _capsule(r: float, length: float) -> Solid:
    tube, caps = math.pi * r * r * length, 4 / 3 * math.pi * r**3
    across = tube * (3 * r * r + length * length) / 12 + caps * (
        0.4 * r * r + length * (length / 4 + 0.375 * r)
    )
    along = tube * r * r / 2 + caps * 0.4 * r * r
    return tube + caps, 0.0, (across / (tube + caps),) * 2 + (along / (tube + caps),)


def _cone(r: float, length: float) -> Solid:
    across = 0.0375 * (4 * r * r + length * length)
    return math.pi * r * r * length / 3, -length / 4, (across, across, 0.3 * r * r)


#: Shapes, each with the children that hold its sizes: how many numbers there are in each.
SHAPES: dict[str, tuple[dict[str, int], Callable[..., Solid]]] = {
    "box": ({"size": 3}, _box), "sphere": ({"radius": 1}, _sphere),
    "cylinder": ({"radius": 1, "length": 1}, _cylinder), "capsule": ({"radius": 1, "length": 1}, _capsule),
    "ellipsoid": ({"radii": 3}, _ellipsoid), "cone": ({"radius": 1, "length": 1}, _cone),
}  # fmt: skip


def inertia_of_shapes(item: Item, inertial: XmlNode, models: SdfModels) -> tuple[float, Array, Array]:
    """Return mass [kg], centre of mass, shape (3,), [m], and inertia about it, shape (3, 3), of a link.

    Args:
        item: The link.
        inertial: Its `<inertial>`; a `<mass>` scales the inertia.
        models: Where everything stands.

    Raises:
        ModelError: There is no shape, one has no inertia here, or the file states inertia, too.
    """
    for tag in ("pose", "inertia"):
        if inertial.child(tag) is not None:
            raise inertial.error(f'<{tag}> beside auto="true", which computes it; remove one of them')
    collisions = item.node.children("collision")
    if not collisions:
        raise inertial.error('auto="true" computes inertia from <collision>s, and the link has none')
    general = _density(inertial, WATER)
    masses, points, tensors = [], [], []
    for collision in collisions:
        mass, point, tensor = _solid(collision, _density(collision, general))
        at = _placed(collision, item, models)
        masses.append(mass)
        points.append(at[:3, :3] @ point + at[:3, 3])
        tensors.append(at[:3, :3] @ tensor @ at[:3, :3].T)
    total, arms = sum(masses), np.array(points)
    com = np.array(masses) @ arms / total
    inertia = sum(tensors) + sum(
        m * (r @ r * np.eye(3) - np.outer(r, r)) for m, r in zip(masses, arms - com, strict=True)
    )
    stated = inertial.child("mass")
    scale = _positive(stated) / total if stated is not None else 1.0
    return total * scale, com, np.asarray(inertia * scale)


def _solid(collision: XmlNode, density: float) -> tuple[float, Array, Array]:
    """Return mass, centre of mass and inertia about it of a shape, in its own frame."""
    geometry = collision.required_child("geometry")
    found = geometry.children()
    if len(found) != 1:
        raise geometry.error(f"{len(found)} shapes; a collision has one")
    (shape,) = found
    if shape.tag not in SHAPES:
        raise shape.error(
            f'auto="true" computes no inertia of <{shape.tag}>; write <mass>, <pose> and <inertia> of the '
            f"link, or another shape: {listed(SHAPES)}"
        )
    sizes, solid = SHAPES[shape.tag]
    numbers: list[float] = []
    for tag, count in sizes.items():
        numbers += _sizes(shape.required_child(tag), count)
    volume, centre, moments = solid(*numbers)
    mass = density * volume
    return mass, np.array([0.0, 0.0, centre]), mass * np.diag(moments)


def _sizes(node: XmlNode, count: int) -> Sequence[float]:
    numbers = [float(x) for x in node.numbers("", count)]
    if min(numbers) <= 0:
        raise node.error(f"{min(numbers):g} is no size; it must be above 0")
    return numbers


def _positive(node: XmlNode) -> float:
    number = node.number()
    if number <= 0:
        raise node.error(f"{number:g} is not above 0")
    return number


def _density(node: XmlNode, default: float) -> float:
    stated = node.child("density")
    return default if stated is None else _positive(stated)


def _placed(collision: XmlNode, item: Item, models: SdfModels) -> Array:
    """Return the place of a shape in its link, shape (4, 4)."""
    stated = collision.child("pose")
    at, frame = pose(stated), relative_to(stated)
    if not frame:
        return at
    base = models.pose(models.resolve(item.scope, frame, collision))
    return inverse(models.pose(item)) @ base @ at
