"""Shapes of a robot as plain data: triangle meshes, each fixed to a body.

Body 0 is the root body. The child of URDF joint i is body i + 1, as in `HybridRobot.bodies`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from ..spatial import Array, Index

#: Part of the robot that a shape represents.
Role = Literal["link", "motor", "joint", "closure"]


class BodyPoint(NamedTuple):
    """A point of a body.

    Attributes:
        body: Number of the body.
        at: Position in the body's frame, shape (3,), [m].
    """

    body: int
    at: Array


@dataclass(frozen=True, eq=False)
class PictureShape:
    """A triangle mesh fixed to a body, or a rod that grows from a body to another.

    Attributes:
        name: Name of the link, joint or closure that it represents.
        role: Part of the robot that it represents.
        module: Number of its module, -1 for the ground.
        body: Number of its body.
        vertices: Corners, shape (V, 3), [m], in the body's frame; of a rod that grows as from z = 0 to 1.
        faces: Corners of each triangle, counter-clockwise from outside, shape (F, 3).
        colour: Its colour, "#rrggbb"; of links that of their module.
        own_colour: The colour that its file states; None for a shape of no file.
        ends: Ends of a rod that grows, the first of its own body; None for other shapes.
    """

    name: str
    role: Role
    module: int
    body: int
    vertices: Array
    faces: Index
    colour: str
    own_colour: str | None = None
    ends: tuple[BodyPoint, BodyPoint] | None = None


@dataclass(frozen=True, eq=False)
class Picture:
    """All shapes of a robot.

    Attributes:
        shapes: The shapes.
        corners: Lower and upper corner of the robot's bounding box at home, shape (2, 3), [m].
        notes: Shapes of the files that could not be drawn, one line each.
    """

    shapes: tuple[PictureShape, ...]
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
