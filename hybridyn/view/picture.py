"""Shapes of a robot as plain data: rods, balls and solids, each fixed to bodies.

Body 0 is the root body. The child of URDF joint i is body i + 1, as in `HybridRobot.bodies`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..spatial import Array, Index

#: Part of the robot that a shape represents.
Role = Literal["link", "motor", "joint", "closure"]


@dataclass(frozen=True, eq=False)
class Point:
    """A point of a body.

    Attributes:
        body: Number of the body.
        at: Position in the body's frame, shape (3,), [m].
    """

    body: int
    at: Array


@dataclass(frozen=True)
class Rod:
    """A cylinder between two points. Its length varies if they belong to different bodies.

    Attributes:
        name: Name of the link, joint or closure that it represents.
        role: Part of the robot that it represents.
        module: Number of its module, -1 for the ground.
        start: One end.
        end: The other end.
        radius: Its radius [m].
        colour: Its colour, "#rrggbb".
    """

    name: str
    role: Role
    module: int
    start: Point
    end: Point
    radius: float
    colour: str


@dataclass(frozen=True)
class Ball:
    """A sphere at a point; attributes as those of `Rod`."""

    name: str
    role: Role
    module: int
    at: Point
    radius: float
    colour: str


@dataclass(frozen=True, eq=False)
class Solid:
    """A triangle mesh fixed to a body.

    Attributes:
        module: Number of its module, -1 for the ground.
        body: Number of its body.
        vertices: Corners in the body's frame, shape (V, 3), [m].
        faces: Corners of each triangle, counter-clockwise from outside, shape (F, 3).
        colour: Its module's colour, "#rrggbb".
        own_colour: The colour that its file states.
    """

    name: str
    module: int
    body: int
    vertices: Array
    faces: Index
    colour: str
    own_colour: str


@dataclass(frozen=True, eq=False)
class Picture:
    """All shapes of a robot.

    Attributes:
        rods: Cylinders.
        balls: Spheres.
        solids: Triangle meshes.
        corners: Lower and upper corner of the robot's bounding box at home, shape (2, 3), [m].
        notes: Shapes of the files that could not be drawn, one line each.
    """

    rods: tuple[Rod, ...]
    balls: tuple[Ball, ...]
    solids: tuple[Solid, ...]
    corners: Array
    notes: tuple[str, ...] = ()

    @property
    def size(self) -> float:
        """Largest extent at home [m]."""
        return float(np.ptp(self.corners, axis=0).max()) or 1.0

    @property
    def centre(self) -> Array:
        """Centre of the robot at home, shape (3,), [m]."""
        middle: Array = self.corners.mean(axis=0)
        return middle

    @property
    def floor(self) -> float:
        """Height of the ground under the robot [m]."""
        return float(self.corners[0, 2])

    @property
    def modules(self) -> list[int]:
        """Numbers of the modules that have shapes, the ground (-1) first if it has any."""
        shapes: tuple[Rod | Ball | Solid, ...] = (*self.rods, *self.balls, *self.solids)
        return sorted({shape.module for shape in shapes})
