"""Camera of a rendered image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..spatial import Array

#: Azimuth from which a robot is seen [rad].
FRONT = -0.9


@dataclass(frozen=True, eq=False)
class Camera:
    """Perspective camera: position, target and image size.

    Attributes:
        eye: Position in the world, shape (3,), [m].
        target: Point that it looks at, in the world, shape (3,), [m].
        width: Width of the image [pixels].
        height: Height of the image [pixels].
        angle: Half of the field of view along the shorter side of the image [rad].
    """

    eye: Array
    target: Array
    width: int
    height: int
    angle: float = 0.32

    @property
    def axes(self) -> Array:
        """Return the right, up and back directions in the world as columns, shape (3, 3)."""
        back = self.eye - self.target
        back = back / np.linalg.norm(back)
        right = np.cross([0.0, 0.0, 1.0], back)
        right = right / np.linalg.norm(right)
        return np.column_stack([right, np.cross(back, right), back])

    def rays(self, x: Array, y: Array) -> NDArray[np.float32]:
        """Compute the directions in the world from the eye through places of the image.

        Args:
            x: Places from the left side [pixels].
            y: Places from the upper side [pixels], of a shape that fits x.

        Returns:
            Directions, shape (..., 3).
        """
        scale = np.tan(self.angle) / (0.5 * min(self.width, self.height))
        right, up, back = self.axes.astype(np.float32).T
        from_centre = scale * (x - self.width / 2), scale * (self.height / 2 - y)
        u, v = (at.astype(np.float32)[..., None] for at in from_centre)
        return np.asarray(u * right + v * up - back)


def camera_around(
    corners: Array, width: int, height: int, *, turn: float = FRONT, lift: float = 0.38, room: float = 1.04
) -> Camera:
    """Build a camera that sees a whole box.

    Args:
        corners: Lower and upper corner of the box in the world, shape (2, 3), [m].
        width: Width of the image [pixels].
        height: Height of the image [pixels].
        turn: Azimuth of the camera about the vertical [rad].
        lift: Elevation of the camera [rad].
        room: Margin around the box, as a factor of its size in the image.
    """
    away = np.array([np.cos(lift) * np.cos(turn), np.cos(lift) * np.sin(turn), np.sin(lift)])
    centre = corners.mean(axis=0)
    camera = Camera(centre + away, centre, width, height)
    chosen = np.array(np.meshgrid([0, 1], [0, 1], [0, 1])).reshape(3, -1).T
    local = (np.take_along_axis(corners, chosen, axis=0) - centre) @ camera.axes
    half = np.tan(camera.angle) * np.array([width, height]) / min(width, height)
    distance = float((local[:, 2:] + room * np.abs(local[:, :2]) / half).max())
    return Camera(centre + (distance or 1.0) * away, centre, width, height)
