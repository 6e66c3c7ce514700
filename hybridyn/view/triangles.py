"""Rods and balls as triangles: unit shapes, and the transforms that place them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..spatial import Array, Index
from .picture import Ball, Rod
from .placing import Placement


def unit_cylinder(sides: int) -> tuple[Array, Index]:
    """Build a closed cylinder of radius 1 about z from z = 0 to 1: corners (V, 3), triangles (F, 3).

    The caps have separate corners, so that their edges stay sharp in smooth shading.
    """
    angles = 2 * np.pi * np.arange(sides) / sides
    low = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(sides)])
    high = low + np.array([0.0, 0.0, 1.0])
    vertices = np.concatenate([low, high, low, high, [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]])
    i = np.arange(sides)
    j, cap = (i + 1) % sides, 2 * sides
    faces = [(i, j, j + sides), (i, j + sides, i + sides)]
    faces.append((j + cap, i + cap, np.full(sides, 4 * sides)))
    faces.append((i + cap + sides, j + cap + sides, np.full(sides, 4 * sides + 1)))
    return vertices, np.concatenate([np.column_stack(face) for face in faces])


def unit_ball(rings: int) -> tuple[Array, Index]:
    """Build a sphere of radius 1 from rings of latitude: corners (V, 3), triangles (F, 3)."""
    sides = 2 * rings
    heights = np.pi * np.arange(1, rings) / rings
    angles = 2 * np.pi * np.arange(sides) / sides
    theta, phi = (x.ravel() for x in np.meshgrid(heights, angles, indexing="ij"))
    middle = np.column_stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])
    vertices = np.concatenate([middle, [[0, 0, 1], [0, 0, -1]]])
    i = np.arange(sides)
    j, top, bottom = (i + 1) % sides, len(middle), len(middle) + 1
    faces = [np.column_stack([np.full(sides, top), i, j])]
    for ring in range(rings - 2):
        a, b = ring * sides, (ring + 1) * sides
        faces += [np.column_stack([a + i, b + i, b + j]), np.column_stack([a + i, b + j, a + j])]
    last = (rings - 2) * sides
    faces.append(np.column_stack([last + j, last + i, np.full(sides, bottom)]))
    return vertices, np.concatenate(faces)


def rod_transforms(rods: Sequence[Rod], placement: Placement) -> tuple[Array, Array, Array]:
    """Compute the transforms of unit cylinders to rods.

    Returns:
        Axes, shape (N, 3, 3), z along the rod; origins, shape (N, 3), [m]; scales, shape (N, 3): radius,
        radius, length [m].
    """
    start = placement.of([rod.start for rod in rods])
    along = placement.of([rod.end for rod in rods]) - start
    length = np.linalg.norm(along, axis=1)
    z = np.where(length[:, None] > 0, along / np.where(length > 0, length, 1.0)[:, None], [0.0, 0.0, 1.0])
    helper = np.where(np.abs(z[:, 2:]) < 0.9, [0.0, 0.0, 1.0], [1.0, 0.0, 0.0])
    x = np.cross(helper, z)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    axes = np.stack([x, np.cross(z, x), z], axis=2)
    radius = np.array([rod.radius for rod in rods])
    return axes, start, np.column_stack([radius, radius, length])


def ball_transforms(balls: Sequence[Ball], placement: Placement) -> tuple[Array, Array]:
    """Compute the centres, shape (N, 3), [m], and radii, shape (N,), [m], of balls."""
    return placement.of([ball.at for ball in balls]), np.array([ball.radius for ball in balls])
