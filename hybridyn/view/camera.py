"""Camera of a rendered image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

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

    def project(self, points: Array) -> tuple[Array, Array]:
        """Project points to pixels and depths.

        Args:
            points: Points in the world, shape (..., 3), [m].

        Returns:
            Pixels from the upper left corner, shape (..., 2), and distances along the view, shape (...), [m]
            (not positive behind the camera, where pixels are undefined).
        """
        local = (points - self.eye) @ self.axes
        depth = -local[..., 2]
        scale = 0.5 * min(self.width, self.height) / np.tan(self.angle)
        flat = scale * local[..., :2] / np.where(depth > 0, depth, 1.0)[..., None]
        return np.array([self.width / 2, self.height / 2]) + flat * [1.0, -1.0], depth


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
