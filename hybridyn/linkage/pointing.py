"""Prescribed directions of axes and distances of links, as rows of a Newton problem."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..spatial import (
    Array,
    Index,
    along,
    arctan2,
    compose,
    cross,
    hat,
    in_turn,
    length,
    rotate,
    rotate_back,
    rotation_from_vector,
    symbolic,
)
from .motion import Motion
from .tree import Jacobians

#: Sine by which half a turn about any axis is divided.
SMALL_SINE = 1e-4
#: Sine below which a direction is the opposite of another one.
SMALLEST_SINE = 1e-100
#: Least length in divisions [m].
SMALLEST_WAY = 1e-100


def direction_rows(axes: Array, axis: int, wanted: Array) -> tuple[Array, Array]:
    """Compute the turn from a wanted to the actual direction of a link's axis, on numbers or symbols.

    Args:
        axes: Axes of the link, shape (..., 3, 3).
        axis: Number of the axis.
        wanted: The direction, shape (..., 3), in the frame of the axes.

    Returns:
        The turn's components along the link's two other axes, shape (..., 2), and their rows over the angular
        velocity of the link while the direction rests, shape (..., 2, 3).
    """
    others, e = [(axis + 1) % 3, (axis + 2) % 3], np.eye(3)[axis]
    d = rotate_back(axes, wanted)
    turn, cosine, moved = cross(d, e), d[..., axis, None], hat(d)  # it moves in the link's axes
    sine = length(turn)
    if not symbolic(sine):  # half a turn about any axis
        sine = np.where((sine < SMALLEST_SINE) & (cosine < 0.0), SMALL_SINE, sine)
    factor = arctan2(sine, cosine) / sine
    slope = (factor * cosine - 1.0) / (sine * sine)  # where this is rounding, its factors are smaller still
    rows = factor[..., None] * compose(-hat(e), moved)
    rows = rows + (slope * turn)[..., None] * moved[..., axis, None, :]
    return (factor * turn)[..., others], compose(rows[..., others, :], np.swapaxes(axes, -1, -2))


def met_direction_rows(axes: Array, axis: int) -> Array:
    """Return the rows of `direction_rows` where the axis has the direction, shape (..., 2, 3)."""
    return np.swapaxes(axes, -1, -2)[..., [(axis + 1) % 3, (axis + 2) % 3], :]


def away(way: Array) -> tuple[Array, Array]:
    """Return lengths of ways (..., 3), shape (..., 1), and their directions, on numbers or symbols."""
    distance = length(way)
    return distance, way / distance


class DirectionTarget(NamedTuple):
    """The direction of one axis of a link; its position, and its turn about the axis, are free.

    The rows are those components of the rotation vector from the prescribed to the actual direction that are
    along the link's two other axes: it has no component along the axis itself.

    Attributes:
        body: Number of the link's body.
        axis: Number of the axis.
        R: Axes of the frame in which the direction is measured, shape (3, 3), base of the tree.
        shift: Axes of the link in its body, shape (3, 3).
        value: Prescribed directions of length one, shape (T, 3).
        rate: Their time derivatives, shape (T, 3).
        acceleration: Their second time derivatives, shape (T, 3); components along the axis do not count.
        units: Unit of each row, shape (2,): one radian.
    """

    body: int
    axis: int
    R: Array
    shift: Array
    value: Array
    rate: Array
    acceleration: Array
    units: Array

    def _axes(self, motion: Motion) -> Array:
        """Compute the link's axes in the base of the tree, shape (T, 3, 3)."""
        out: Array = np.matmul(motion.R[:, self.body], self.shift)
        return out

    def _rows(self, motion: Motion, samples: Index) -> tuple[Array, Array]:
        """Compute `direction_rows`."""
        return direction_rows(self._axes(motion), self.axis, self.value[samples] @ self.R.T)

    def residual(self, motion: Motion, samples: Index) -> Array:
        """Compute the turn from the prescribed to the actual direction, shape (T, 2), [rad]."""
        out = self._rows(motion, samples)[0]
        opposite = along(self._axes(motion)[:, :, self.axis], self.value[samples] @ self.R.T)[:, 0] < 0.0
        out[opposite & ~out.any(axis=1), 0] = np.pi
        return out

    def point(self, motion: Motion) -> tuple[Array, Array, list[int]]:
        """Return where the body is, shape (T, 3); no row is a length."""
        return motion.p[:, self.body], np.zeros((0, 3)), []

    def matrix(self, tree: Jacobians, motion: Motion, samples: Index | None = None) -> Array:
        """Return the rows over the rates, shape (T, 2, nv)."""
        if samples is None:
            own = met_direction_rows(self._axes(motion), self.axis)
        else:
            own = self._rows(motion, samples)[1]
        rows: Array = np.matmul(own, tree.jacobian(motion, self.body)[:, 3:])
        return rows

    def rates(self, motion: Motion, samples: Index) -> tuple[Array, Array]:
        """Compute prescribed rates, and prescribed accelerations minus the drift, shapes (T, 2)."""
        d, d_dot, d_ddot = (x[samples] @ self.R.T for x in (self.value, self.rate, self.acceleration))
        w, axes = motion.w[:, self.body], self._axes(motion)
        spin = np.einsum("ti,ti->t", w, d)[:, None]
        acceleration = cross(d, d_ddot) - spin * cross(d, w) - motion.w_dot[:, self.body]
        rows = met_direction_rows(axes, self.axis)
        return rotate(rows, cross(d, d_dot)), rotate(rows, acceleration)

    def ahead(self, step: Array) -> DirectionTarget:
        """Return the target after small times, shape (T,), to second order."""
        s = step[:, None]
        turn = rotation_from_vector(cross(self.value, s * self.rate + 0.5 * s * s * self.acceleration))
        return self._replace(value=rotate(turn, self.value))

    def between(self, sample: int, fractions: Array) -> DirectionTarget:
        """Interpolate from a sample to the next by the shortest turn."""
        start, stop = self.value[sample : sample + 2]
        turn = cross(start, stop)
        sine, cosine = np.linalg.norm(turn), start @ stop
        if sine == 0.0 and cosine < 0.0:
            turn = cross(start, np.eye(3)[np.argmin(np.abs(start))])
        angle = np.arctan2(sine, cosine)
        axis = turn / max(float(np.linalg.norm(turn)), SMALLEST_WAY)
        return self._replace(value=rotation_from_vector(fractions[:, None] * angle * axis) @ start)

    def from_here(self, motion: Motion, samples: Index) -> DirectionTarget:
        """Return the way from where the axis points now to the given samples."""
        now = self._axes(motion)[:, :, self.axis] @ self.R
        return self._replace(value=in_turn(now, self.value[samples]))

    def headed(self, motion: Motion, samples: Index, *, on: bool = True) -> DirectionTarget:
        """Return the target itself: a direction has no second triple of angles."""
        return self

    def headed_at(self, motion: Motion, values: Array) -> DirectionTarget:
        """Return the target itself, as `headed` does."""
        return self


class DistanceTarget(NamedTuple):
    """The distance of a link's origin from a point, which may move in a known way.

    Attributes:
        body: Number of the link's body.
        R: Axes of the frame in which the point is known, shape (3, 3), base of the tree.
        p: Origin of that frame, shape (3,), [m], base of the tree.
        shift: The link's origin in its body, shape (3,), [m].
        levels: Prescribed distance, its rate and acceleration, shape (3, T), [m].
        centre: The point in that frame, its rate and acceleration, shape (3, T, 3), [m].
        units: Unit of the row, shape (1,).
    """

    body: int
    R: Array
    p: Array
    shift: Array
    levels: Array
    centre: Array
    units: Array

    def _offset(self, motion: Motion) -> Array:
        """Compute the link's origin seen from the body's, shape (T, 3), [m], base axes."""
        out: Array = np.matmul(motion.R[:, self.body], self.shift)
        return out

    def _away(self, motion: Motion, samples: Index | None) -> tuple[Array, Array]:
        """Compute the distance, shape (T,), and the direction in which it grows, shape (T, 3), base axes."""
        known = np.zeros(len(motion.p), dtype=int) if samples is None else samples
        centre = self.centre[0][known] @ self.R.T + self.p
        way = motion.p[:, self.body] + self._offset(motion) - centre
        distance, direction = away(way)
        return distance[:, 0], direction

    def residual(self, motion: Motion, samples: Index) -> Array:
        """Compute the actual minus the prescribed distance, shape (T, 1), [m]."""
        out: Array = (self._away(motion, samples)[0] - self.levels[0][samples])[:, None]
        return out

    def point(self, motion: Motion) -> tuple[Array, Array, list[int]]:
        """Return where the link is, shape (T, 3); its position along no fixed axis is known."""
        return motion.p[:, self.body] + self._offset(motion), np.zeros((0, 3)), []

    def matrix(self, tree: Jacobians, motion: Motion, samples: Index | None = None) -> Array:
        """Return the row over the rates, shape (T, 1, nv)."""
        J, direction = tree.jacobian(motion, self.body), self._away(motion, samples)[1]
        moved = J[:, :3] - np.matmul(hat(self._offset(motion)), J[:, 3:])
        row: Array = np.matmul(direction[:, None], moved)
        return row

    def rates(self, motion: Motion, samples: Index) -> tuple[Array, Array]:
        """Compute the prescribed rate, and the prescribed acceleration minus the drift, shapes (T, 1)."""
        distance, n = self._away(motion, samples)
        offset, w, w_dot = self._offset(motion), motion.w[:, self.body], motion.w_dot[:, self.body]
        _, c_dot, c_ddot = (x[samples] @ self.R.T for x in self.centre)
        u = motion.p_dot[:, self.body] + cross(w, offset) - c_dot
        drift = motion.p_ddot[:, self.body] + cross(w_dot, offset) + cross(w, cross(w, offset)) - c_ddot
        across = u - np.einsum("ti,ti->t", n, u)[:, None] * n
        turning = np.einsum("ti,ti->t", across, across) / distance
        rate = self.levels[1][samples] + np.einsum("ti,ti->t", n, c_dot)
        acceleration = self.levels[2][samples] - turning - np.einsum("ti,ti->t", n, drift)
        return rate[:, None], acceleration[:, None]

    def ahead(self, step: Array) -> DistanceTarget:
        """Return the target after small times, shape (T,), to second order."""
        levels, centre, s = self.levels.copy(), self.centre.copy(), step[:, None]
        levels[0] += step * levels[1] + 0.5 * step * step * levels[2]
        centre[0] += s * centre[1] + 0.5 * s * s * centre[2]
        return self._replace(levels=levels, centre=centre)

    def between(self, sample: int, fractions: Array) -> DistanceTarget:
        """Interpolate distance and point linearly from a sample to the next."""
        levels, centre = (
            x[:, sample : sample + 1]
            + (x[:, sample + 1 : sample + 2] - x[:, sample : sample + 1])
            * fractions.reshape(-1, *(1,) * (x.ndim - 2))
            for x in (self.levels, self.centre)
        )
        return self._replace(levels=levels, centre=centre)

    def from_here(self, motion: Motion, samples: Index) -> DistanceTarget:
        """Return the way from the distance now to those of the given samples."""
        levels, centre = (np.repeat(x[:, samples], 2, axis=1) for x in (self.levels, self.centre))
        levels[0, ::2] = self._away(motion, samples)[0]
        return self._replace(levels=levels, centre=centre)

    def headed(self, motion: Motion, samples: Index, *, on: bool = True) -> DistanceTarget:
        """Return the target itself: it prescribes no angle."""
        return self

    def headed_at(self, motion: Motion, values: Array) -> DistanceTarget:
        """Return the target itself, as `headed` does."""
        return self
