"""Render a robot without a screen: rays to its shaded triangles, an array of pixels or a PNG file."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..colours import rgb
from ..spatial import Array
from .camera import Camera
from .picture import Picture
from .placing import Placement

Image = NDArray[np.uint8]

#: Samples along each side of a pixel at an edge; their mean is the pixel.
FINER = 2
#: Direction towards the light, in the world.
LIGHT = np.array([0.38, -0.42, 0.82])
#: Brightness of surfaces away from the light, and the additional brightness of those that face it.
AMBIENT, DIFFUSE = 0.52, 0.55
#: Number of squares along one side of the floor.
FLOOR_SQUARES = 12
#: Half of a floor line's width relative to the robot's size.
FLOOR_LINE = 0.0012
BACKGROUND, FLOOR, INK = "#ffffff", "#e2e5e9", "#30353c"


def render(picture: Picture, placement: Placement, camera: Camera, *, own_colours: bool = False) -> Image:
    """Render an image of a robot.

    Args:
        picture: The robot's shapes.
        placement: Poses of the bodies.
        camera: The camera.
        own_colours: Whether shapes have the colours of their files instead of those of their modules.

    Returns:
        Red, green and blue, shape (height, width, 3).
    """
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    floor = _floor(picture)
    corners, colours = triangles(picture, placement, own_colours=own_colours)
    scene = EmbreeScene()
    TriangleMesh(scene, (np.concatenate([corners, floor]) - camera.eye).astype(np.float32))
    lit = np.clip(colours * _light(corners, camera)[:, None], 0, 1)
    shades = np.concatenate([lit, _colours(FLOOR, len(floor)), _colours(BACKGROUND, 1)]).astype(np.float32)

    def seen(x: Any, y: Any) -> Any:
        """Return the colours at places of the image [pixels], shape (..., 3)."""
        rays = camera.rays(x, y)
        hit = scene.run(np.zeros_like(rays.reshape(-1, 3)), rays.reshape(-1, 3))
        return shades[hit].reshape(rays.shape)  # a miss is -1, the background

    image = seen(np.arange(camera.width) + 0.5, np.arange(camera.height)[:, None] + 0.5)
    edge = np.zeros(image.shape[:2], dtype=bool)
    for axis, by in ((0, 1), (0, -1), (1, 1), (1, -1)):
        edge |= (image != np.roll(image, by, axis)).any(axis=2)
    y, x = (at[:, None] for at in np.nonzero(edge))
    parts = (np.arange(FINER) + 0.5) / FINER
    image[edge] = seen(x + np.tile(parts, FINER), y + np.repeat(parts, FINER)).mean(axis=1)
    return np.asarray(np.round(255 * image), dtype=np.uint8)


def _light(corners: Array, camera: Camera) -> Array:
    """Compute the brightness of triangles, shapes (N, 3, 3) and (N,), on the side that the camera sees."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = normals / np.where(size > 0, size, 1)
    normals[np.einsum("ij,ij->i", normals, camera.eye - corners.mean(axis=1)) < 0] *= -1
    bright: Array = AMBIENT + DIFFUSE * np.maximum(normals @ (LIGHT / np.linalg.norm(LIGHT)), 0)
    return bright


def triangles(picture: Picture, placement: Placement, *, own_colours: bool = False) -> tuple[Array, Array]:
    """Compute all triangles of a picture.

    Args:
        picture: The robot's shapes.
        placement: Poses of the bodies.
        own_colours: Whether shapes have the colours of their files instead of those of their modules.

    Returns:
        Corners in the world, shape (N, 3, 3), [m]; and colours, shape (N, 3), 0 to 1.
    """
    corners, colours = [np.zeros((0, 3, 3))], [np.zeros((0, 3))]
    for shape in picture.shapes:
        corners.append(placement.of(shape)[shape.faces])
        colour = shape.own_colour if own_colours and shape.own_colour else shape.colour
        colours.append(_colours(colour, len(shape.faces)))
    return np.concatenate(corners), np.concatenate(colours)


def labelled(image: Image, text: str) -> Image:
    """Write a line of text into the upper left corner of an image.

    Args:
        image: The image, shape (height, width, 3).

    Returns:
        A new image.
    """
    from PIL import Image as Pixels
    from PIL import ImageDraw, ImageFont

    size = max(12, image.shape[0] // 36)
    drawn: Any = Pixels.fromarray(image)
    ImageDraw.Draw(drawn).text((size, size), text, fill=INK, font=ImageFont.load_default(size))
    return np.asarray(drawn).copy()


def save_png(image: Image, file: str) -> None:
    """Write an image as a PNG file."""
    from PIL import Image as Pixels

    Pixels.fromarray(image).save(file, format="PNG")


def _colours(name: str, count: int) -> Array:
    """Return a colour as numbers from 0 to 1, repeated, shape (count, 3)."""
    return np.tile(np.array(rgb(name)) / 255, (count, 1))


def _floor(picture: Picture) -> Array:
    """Compute the lines of the floor as triangles in the world, shape (N, 3, 3), [m]."""
    half, thick = 0.75 * picture.size, FLOOR_LINE * picture.size
    lines = np.linspace(-half, half, FLOOR_SQUARES + 1)
    strips = np.array([[(at - thick, -half), (at + thick, -half), (at + thick, half), (at - thick, half)]
                       for at in lines])  # fmt: skip
    strips = np.concatenate([strips, strips[:, :, ::-1]]) + picture.centre[:2]
    corners = np.insert(strips, 2, picture.floor, axis=2)
    return np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])
