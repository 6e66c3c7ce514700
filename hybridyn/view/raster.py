"""Rasterize triangles with a depth buffer in NumPy, without a graphics card or a display."""

from __future__ import annotations

import numpy as np

from ..spatial import Array

#: Edge lengths of the boxes of pixels in which triangles are tested together.
BOXES = (3, 6, 12, 24, 48)
#: Largest number of pixels tested at once.
AT_ONCE = 200_000
#: A pixel on an edge belongs to both triangles: rounding must leave no gap between them.
EDGE_SLACK = -1e-9


class Raster:
    """An image and its depths.

    Attributes:
        colour: Red, green and blue, 0 to 1, shape (height, width, 3).
        nearness: One over the depth, 0 for the background, shape (height, width), [1/m].
    """

    def __init__(self, background: Array) -> None:
        """Start with a background, shape (height, width, 3)."""
        self.colour = background.copy()
        self.nearness = np.zeros(background.shape[:2])

    def fill(self, corners: Array, depths: Array, colours: Array) -> None:
        """Draw triangles.

        Args:
            corners: Corners in pixels, shape (N, 3, 2).
            depths: Depths of the corners, shape (N, 3), [m]; all positive.
            colours: Colours, shape (N, 3).
        """
        height, width, _ = self.colour.shape
        seen = (corners.max(axis=1) > 0).all(axis=1) & (corners.min(axis=1) < [width, height]).all(axis=1)
        corners, near, colours = _divided(corners[seen], 1.0 / depths[seen], colours[seen], BOXES[-1] - 2)
        low = np.clip(np.floor(corners.min(axis=1)), 0, [width, height]).astype(int)
        high = np.clip(np.ceil(corners.max(axis=1)) + 1, 0, [width, height]).astype(int)
        edge = (high - low).max(axis=1)
        inside = (high > low).all(axis=1)
        done = 0
        for box in BOXES:
            chosen = np.flatnonzero(inside & (edge > done) & (edge <= box))
            done = box
            step = max(1, AT_ONCE // box**2)
            for first in range(0, len(chosen), step):
                at = chosen[first : first + step]
                self._fill_boxes(low[at], box, corners[at], near[at], colours[at])

    def _fill_boxes(self, low: Array, box: int, corners: Array, near: Array, colours: Array) -> None:
        """Draw triangles whose pixels lie in boxes of `box` pixels at `low`."""
        height, width, _ = self.colour.shape
        a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
        area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
        area = np.where(np.abs(area) < 1e-12, np.nan, area)
        x = low[:, :1] + np.arange(box) + 0.5
        y = low[:, 1:] + np.arange(box) + 0.5
        hit = (x < width)[:, None, :] & (y < height)[:, :, None]
        shares = []
        for p, q in ((b, c), (c, a), (a, b)):  # each coordinate is the sum of a row term and a column term
            d = (q - p) / area[:, None]
            along = -d[:, 1:] * (x - p[:, :1])
            across = d[:, :1] * (y - p[:, 1:])
            shares.append(along[:, None, :] + across[:, :, None])
            hit &= shares[-1] >= EDGE_SLACK
        which = np.nonzero(hit)
        u, v, w = (share[which] for share in shares)
        first = which[0]
        nearness = u * near[first, 0] + v * near[first, 1] + w * near[first, 2]
        pixel = (low[first, 1] + which[1]) * width + low[first, 0] + which[2]
        order = np.argsort(nearness, kind="stable")  # the nearest of several on one pixel is written last
        pixel, nearness, triangle = pixel[order], nearness[order], first[order]
        buffer, image = self.nearness.reshape(-1), self.colour.reshape(-1, 3)
        closer = nearness > buffer[pixel]
        pixel, nearness, triangle = pixel[closer], nearness[closer], triangle[closer]
        buffer[pixel] = nearness
        image[pixel] = colours[triangle]


def _divided(corners: Array, near: Array, colours: Array, most: float) -> tuple[Array, Array, Array]:
    """Halve triangles at their longest edge until none is wider or higher than `most` pixels.

    Nearness is linear over the image, so the halves have exact values.
    """
    small: list[tuple[Array, Array, Array]] = []
    while len(corners):
        large = np.ptp(corners, axis=1).max(axis=1) > most
        small.append((corners[~large], near[~large], colours[~large]))
        corners, near, colours = corners[large], near[large], colours[large]
        edges = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
        turn = (edges.argmax(axis=1)[:, None] + np.arange(3)) % 3  # the longest edge comes first
        corners = np.take_along_axis(corners, turn[:, :, None], axis=1)
        near = np.take_along_axis(near, turn, axis=1)
        middle, at = (corners[:, 0] + corners[:, 1]) / 2, (near[:, 0] + near[:, 1]) / 2
        a, b, c = (corners[:, i] for i in range(3))
        corners = np.concatenate([np.stack([a, middle, c], 1), np.stack([middle, b, c], 1)])
        u, v, w = (near[:, i] for i in range(3))
        near = np.concatenate([np.stack([u, at, w], 1), np.stack([at, v, w], 1)])
        colours = np.concatenate([colours, colours])
    small.append((corners, near, colours))
    a, b, c = (np.concatenate(parts) for parts in zip(*small, strict=True))
    return a, b, c
