"""Volume, centre and inertia of the primitive shapes of USD, for masses that a file states by density."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..records import Array
from .bodies import SINGLE_PRECISION
from .stage import Prim

#: Shapes without volume, which have no mass.
FLAT = ("Plane",)


@dataclass(frozen=True, eq=False)
class Solid:
    """A solid of density 1 in the axes of its prim.

    Attributes:
        volume: Volume [m^3].
        centre: Centre of mass, shape (3,), [m].
        inertia: Inertia about it per density, shape (3, 3), [m^5].
    """

    volume: float
    centre: Array
    inertia: Array


def solid_of(prim: Prim, scale: Array) -> Solid | None:
    """Return the solid of a shape, or None if its type is none that is computed.

    Args:
        scale: Factors along its axes, units included, shape (3,), [m].

    Raises:
        ModelError: The scale makes it another shape, or a size is not positive.
    """
    build = SHAPES.get(prim.kind)
    return None if build is None else build(prim, scale)


def _size(prim: Prim, name: str, default: float) -> float:
    value = prim.number(name, default)
    if value <= 0:
        raise prim.error(f"'{name}' is {value:g}; a solid has positive sizes")
    return value


def _cube(prim: Prim, scale: Array) -> Solid:
    a, b, c = _size(prim, "size", 2.0) * scale
    volume = float(a * b * c)
    moments = np.array([b * b + c * c, a * a + c * c, a * a + b * b]) / 12
    return Solid(volume, np.zeros(3), np.diag(volume * moments))


def _sphere(prim: Prim, scale: Array) -> Solid:
    _refuse_stretched(prim, scale)
    r = _size(prim, "radius", 1.0) * float(scale[0])
    volume = 4 / 3 * np.pi * r**3
    return Solid(volume, np.zeros(3), np.eye(3) * (0.4 * volume * r * r))


def _cylinder(prim: Prim, scale: Array) -> Solid:
    r, h, axis = _round(prim, scale, 2.0)
    volume = np.pi * r * r * h
    return _about(axis, volume, 0.0, volume * r * r / 2, volume * (r * r / 4 + h * h / 12))


def _capsule(prim: Prim, scale: Array) -> Solid:
    _refuse_stretched(prim, scale)
    r, h, axis = _round(prim, scale, 1.0, 0.5)
    barrel, ball = np.pi * r * r * h, 4 / 3 * np.pi * r**3
    along = barrel * r * r / 2 + ball * 0.4 * r * r
    across = barrel * (r * r / 4 + h * h / 12) + ball * (0.4 * r * r + h * h / 4 + 3 / 8 * h * r)
    return _about(axis, barrel + ball, 0.0, along, across)


def _cone(prim: Prim, scale: Array) -> Solid:
    r, h, axis = _round(prim, scale, 2.0)
    volume = np.pi * r * r * h / 3
    return _about(axis, volume, -h / 4, volume * 0.3 * r * r, volume * 3 / 80 * (4 * r * r + h * h))


def _round(prim: Prim, scale: Array, height: float, radius: float = 1.0) -> tuple[float, float, int]:
    """Return radius [m], height [m] and axis of a shape that is round about an axis."""
    word = prim.word("axis", "Z")
    if word not in ("X", "Y", "Z"):
        raise prim.error(f"axis '{word}' is none of X, Y, Z")
    axis = "XYZ".index(word)
    across = [i for i in range(3) if i != axis]
    _refuse_stretched(prim, scale[across])
    return (
        _size(prim, "radius", radius) * float(scale[across[0]]),
        _size(prim, "height", height) * float(scale[axis]),
        axis,
    )


def _about(axis: int, volume: float, shift: float, along: float, across: float) -> Solid:
    """Return a solid that is round about an axis, its centre shifted along it."""
    centre, moments = np.zeros(3), np.full(3, across)
    centre[axis], moments[axis] = shift, along
    return Solid(volume, centre, np.diag(moments))


def _refuse_stretched(prim: Prim, scale: Array) -> None:
    if np.ptp(scale) > SINGLE_PRECISION * np.max(scale):
        raise prim.error(
            f"different scales make this {prim.kind.lower()} another shape; author the body's physics:mass, "
            "physics:centerOfMass and physics:diagonalInertia"
        )


#: Shapes whose mass is computed, by type.
SHAPES: dict[str, Callable[[Prim, Array], Solid]] = {
    "Cube": _cube, "Sphere": _sphere, "Cylinder": _cylinder, "Capsule": _capsule, "Cone": _cone,
}  # fmt: skip
