"""Render a robot without a screen: its shaded triangles as an array of pixels or a PNG file."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..colours import rgb
from ..spatial import Array, Mask, rotate
from .camera import Camera
from .picture import Picture
from .placing import Placement
from .raster import Raster
from .triangles import ball_transforms, rod_transforms, unit_ball, unit_cylinder

Image = NDArray[np.uint8]

#: Sides of a rod, and rings of latitude of a ball.
SIDES, RINGS = 20, 10
#: Samples per pixel along each side of the image; their mean is the pixel.
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
        own_colours: Whether shapes have the colours of their files instead of those of their modules.

    Returns:
        Red, green and blue, shape (height, width, 3).
    """
    width, height = FINER * camera.width, FINER * camera.height
    fine = Camera(camera.eye, camera.target, width, height, camera.angle)
    raster = Raster(np.broadcast_to(_colours([BACKGROUND], 1)[0], (height, width, 3)))
    lines = _floor(picture)
    _fill(raster, fine, lines, _colours([FLOOR], len(lines)))
    corners, colours, closed = triangles(picture, placement, own_colours=own_colours)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = normals / np.where(size > 0, size, 1)
    away = np.einsum("ij,ij->i", normals, camera.eye - corners.mean(axis=1)) < 0
    seen = ~(away & closed)
    normals[away] *= -1  # open meshes show their inside, which is lit like the outside
    light = AMBIENT + DIFFUSE * np.maximum(normals @ (LIGHT / np.linalg.norm(LIGHT)), 0)
    _fill(raster, fine, corners[seen], np.clip(colours * light[:, None], 0, 1)[seen])
    mean = raster.colour.reshape(camera.height, FINER, camera.width, FINER, 3).mean(axis=(1, 3))
    image: Image = np.round(255 * mean).astype(np.uint8)
    return image


def _fill(raster: Raster, camera: Camera, corners: Array, colours: Array) -> None:
    """Draw the triangles in front of the camera."""
    flat, depths = camera.project(corners)
    front = (depths > 0).all(axis=1)
    raster.fill(flat[front], depths[front], colours[front])


def triangles(
    picture: Picture, placement: Placement, *, own_colours: bool = False
) -> tuple[Array, Array, Mask]:
    """Compute all triangles of a picture.

    Args:
        picture: The robot's shapes.
        placement: Poses of the bodies.
        own_colours: Whether shapes have the colours of their files instead of those of their modules.

    Returns:
        Corners in the world, shape (N, 3, 3), [m]; colours, shape (N, 3), 0 to 1; and whether each triangle
        belongs to a rod or a ball, which are closed surfaces, shape (N,).
    """
    corners, colours = [np.zeros((0, 3, 3))], [np.zeros((0, 3))]
    if picture.rods:
        vertices, faces = unit_cylinder(SIDES)
        axes, origins, scales = rod_transforms(picture.rods, placement)
        placed = np.einsum("nij,nvj->nvi", axes, vertices * scales[:, None]) + origins[:, None]
        corners.append(placed[:, faces].reshape(-1, 3, 3))
        colours.append(_colours([rod.colour for rod in picture.rods], len(faces)))
    if picture.balls:
        vertices, faces = unit_ball(RINGS)
        centres, radii = ball_transforms(picture.balls, placement)
        placed = centres[:, None] + vertices * radii[:, None, None]
        corners.append(placed[:, faces].reshape(-1, 3, 3))
        colours.append(_colours([ball.colour for ball in picture.balls], len(faces)))
    closed = sum(map(len, corners))
    for solid in picture.solids:
        placed = placement.p[solid.body] + rotate(placement.R[solid.body], solid.vertices)
        corners.append(placed[solid.faces])
        colours.append(_colours([solid.own_colour if own_colours else solid.colour], len(solid.faces)))
    every = np.concatenate(corners)
    return every, np.concatenate(colours), np.arange(len(every)) < closed


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


def _colours(names: list[str], each: int) -> Array:
    """Return colours as numbers from 0 to 1, each of them repeated, shape (len(names) * each, 3)."""
    return np.repeat(np.array([rgb(name) for name in names]) / 255, each, axis=0)


def _floor(picture: Picture) -> Array:
    """Compute the lines of the floor as triangles in the world, shape (N, 3, 3), [m]."""
    half, thick = 0.75 * picture.size, FLOOR_LINE * picture.size
    x, y = picture.centre[:2]
    out = []
    for at in np.linspace(-half, half, FLOOR_SQUARES + 1):
        for begin in np.linspace(-half, half, FLOOR_SQUARES + 1)[:-1]:  # short pieces fit in small boxes
            end = begin + 2 * half / FLOOR_SQUARES
            for u, v in (((at - thick, begin), (at + thick, end)), ((begin, at - thick), (end, at + thick))):
                a, b, c, d = (u[0], u[1]), (v[0], u[1]), (v[0], v[1]), (u[0], v[1])
                out += [[a, b, c], [a, c, d]]
    flat = np.array(out) + np.array([x, y])
    return np.concatenate([flat, np.full((*flat.shape[:2], 1), picture.floor)], axis=2)
