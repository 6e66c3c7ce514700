"""Prescribed poses of bodies of a tree, complete or partial, as rows of a Newton problem.

The coordinates of a partial pose are x, y, z of the body's origin and roll, pitch, yaw (`angles`) in the base
of the tree. Any N of them are the paper's v_r of a module with N freedoms.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..spatial import (
    Array,
    Index,
    Mask,
    cross,
    hat,
    in_turn,
    rotate,
    rotation_from_vector,
    rotation_vector,
)
from .angles import angles_of, angular_drift, angular_map, headings_along, plain_heading, rate_map, wrapped
from .motion import Motion
from .pointing import DirectionTarget, DistanceTarget
from .tree import Jacobians

COORDINATES = ("x", "y", "z", "roll", "pitch", "yaw")
#: Angles [rad] that differ by less are one, when the triples of a rotation are told apart.
SAME_ANGLE = 1e-6


class PoseTarget(NamedTuple):
    """A body's complete pose in the base of its tree, or its orientation alone: its position is free then.

    Attributes:
        body: Number of the body.
        goal: Its prescribed motion in the base of the tree, T samples.
        units: Unit of each row, shape (6,): the module's length, then one radian; of an orientation, shape
            (3,).
    """

    body: int
    goal: Motion
    units: Array

    @property
    def lengths(self) -> int:
        """Number of rows of the position."""
        return len(self.units) - 3

    @property
    def _rows(self) -> slice:
        """The rows of a whole pose that these are."""
        return slice(3 - self.lengths, 6)

    def residual(self, motion: Motion, samples: Index) -> Array:
        """Compute the actual minus the prescribed pose, shape (T, rows), base axes."""
        wanted = self.goal.R[samples]
        turn = rotation_vector(np.matmul(motion.R[:, self.body], np.swapaxes(wanted, 1, 2)))
        way = motion.p[:, self.body] - self.goal.p[samples]
        return np.concatenate([way[:, : self.lengths], turn], axis=1)

    def point(self, motion: Motion) -> tuple[Array, Array, list[int]]:
        """Return where the body is, shape (T, 3), and the axes, shape (3, 3) or (0, 3), of these rows."""
        return motion.p[:, self.body], np.eye(3)[: self.lengths], [0, 1, 2][: self.lengths]

    def matrix(self, tree: Jacobians, motion: Motion, samples: Index | None = None) -> Array:
        """Return the rows over the rates, shape (T, rows, nv)."""
        return tree.jacobian(motion, self.body)[:, self._rows]

    def rates(self, motion: Motion, samples: Index) -> tuple[Array, Array]:
        """Compute prescribed velocities, and prescribed accelerations minus the drift, shapes (T, rows)."""
        bias = np.concatenate([motion.p_ddot[:, self.body], motion.w_dot[:, self.body]], axis=1)
        velocity = np.concatenate([self.goal.p_dot, self.goal.w], axis=1)
        acceleration = np.concatenate([self.goal.p_ddot, self.goal.w_dot], axis=1)
        return velocity[samples, self._rows], (acceleration[samples] - bias)[:, self._rows]

    def ahead(self, step: Array) -> PoseTarget:
        """Return the target after small times, shape (T,), to second order."""
        return self._replace(goal=self.goal.ahead(step))

    def between(self, sample: int, fractions: Array) -> PoseTarget:
        """Interpolate from a sample to the next: linear position, rotation about a fixed axis."""
        (R0, R1), (p0, p1) = self.goal.R[sample : sample + 2], self.goal.p[sample : sample + 2]
        turn = rotation_from_vector(fractions[:, None] * rotation_vector(R0.T @ R1))
        p = p0 + fractions[:, None] * (p1 - p0)
        return self._replace(goal=Motion.at_rest(len(p), R0 @ turn, p))

    def from_here(self, motion: Motion, samples: Index) -> PoseTarget:
        """Return the way from where the body is now to the given samples."""
        here, there = motion.of_body(self.body), self.goal.take(samples)
        return self._replace(goal=Motion(*map(in_turn, here.arrays, there.arrays)))

    def headed(self, motion: Motion, samples: Index, *, on: bool = True) -> PoseTarget:
        """Return the target itself: a complete rotation has no second triple of angles."""
        return self

    def headed_at(self, motion: Motion, values: Array) -> PoseTarget:
        """Return the target itself, as `headed` does."""
        return self


class CoordinateTarget(NamedTuple):
    """Some coordinates of a body's pose in the base of its tree, among them at most two angles.

    A rotation has two triples of angles. At each sample, the triple near its heading is meant.

    Attributes:
        body: Number of the body.
        links: The link, and the link in which the coordinates are measured.
        names: The prescribed coordinates, a subset of `COORDINATES`.
        R: Axes of the frame in which the coordinates are measured, shape (3, 3), base of the tree.
        p: Origin of that frame, shape (3,), [m], base of the tree.
        shift: Placement of the link in its body, R (3, 3) and p (3,).
        value: Prescribed coordinates, shape (T, names), [m, rad].
        rate: Prescribed rates, shape (T, names).
        acceleration: Prescribed accelerations, shape (T, names).
        units: Unit of each row.
        heading: A yaw near that of the triple that is meant, shape (T,), [rad]; None for the upright triple.
    """

    body: int
    links: tuple[str, str]
    names: tuple[str, ...]
    R: Array
    p: Array
    shift: tuple[Array, Array]
    value: Array
    rate: Array
    acceleration: Array
    units: Array
    heading: Array | None = None

    @property
    def _rows(self) -> Index:
        """The indices of the coordinates in `COORDINATES`."""
        return np.array([COORDINATES.index(name) for name in self.names])

    @property
    def turns(self) -> bool:
        """Whether an angle is prescribed."""
        return bool((self._rows >= 3).any())

    def axes(self, motion: Motion) -> Array:
        """Compute the link's axes in the frame in which coordinates are measured, shape (T, 3, 3)."""
        out: Array = np.matmul(self.R.T, np.matmul(motion.R[:, self.body], self.shift[0]))
        return out

    def _offset(self, motion: Motion) -> Array:
        """Compute the link's origin seen from the body's, shape (T, 3), [m], base axes."""
        out: Array = np.matmul(motion.R[:, self.body], self.shift[1])
        return out

    def _angles(self, motion: Motion, samples: Index | None) -> Array:
        """Compute roll, pitch and yaw of the triple that is meant, shape (T, 3), [rad]."""
        heading = None if self.heading is None or samples is None else self.heading[samples]
        return angles_of(self.axes(motion), heading)

    def coordinates(self, motion: Motion, samples: Index) -> Array:
        """Compute the actual coordinates, shape (T, rows), [m, rad]."""
        out = (motion.p[:, self.body] + self._offset(motion) - self.p) @ self.R
        if self.turns:
            out = np.concatenate([out, self._angles(motion, samples)], axis=1)
        coordinates: Array = out[:, self._rows]
        return coordinates

    def residual(self, motion: Motion, samples: Index) -> Array:
        """Compute actual minus prescribed coordinates, shape (T, rows); angles wrapped to half a turn."""
        out: Array = self.coordinates(motion, samples) - self.value[samples]
        angle = self._rows >= 3
        out[:, angle] = wrapped(out[:, angle])
        return out

    def missed(self, motion: Motion, samples: Index, tolerance: float) -> Mask:
        """Check at which samples a scaled residual is above a tolerance, shape (T,)."""
        out: Mask = np.abs(self.residual(motion, samples) / self.units).max(axis=1) > tolerance
        return out

    def point(self, motion: Motion) -> tuple[Array, Array, list[int]]:
        """Return where the link is, shape (T, 3), and the axes, shape (k, 3), of the rows of lengths."""
        rows = np.flatnonzero(self._rows < 3).tolist()
        return motion.p[:, self.body] + self._offset(motion), self.R.T[self._rows[rows]], rows

    def matrix(self, tree: Jacobians, motion: Motion, samples: Index | None = None) -> Array:
        """Return the rows over the rates, shape (T, rows, nv), of the upright triple without `samples`."""
        J = tree.jacobian(motion, self.body)
        out: Array = np.matmul(self.R.T, J[:, :3] - np.matmul(hat(self._offset(motion)), J[:, 3:]))
        if self.turns:
            turning = np.matmul(rate_map(self._angles(motion, samples)), np.matmul(self.R.T, J[:, 3:]))
            out = np.concatenate([out, turning], axis=1)
        return out[:, self._rows]

    def rates(self, motion: Motion, samples: Index) -> tuple[Array, Array]:
        """Compute prescribed rates, and prescribed accelerations minus the drift, shapes (T, rows)."""
        offset = self._offset(motion)
        w, w_dot = motion.w[:, self.body], motion.w_dot[:, self.body]
        caused = (motion.p_ddot[:, self.body] + cross(w_dot, offset) + cross(w, cross(w, offset))) @ self.R
        if self.turns:
            angles = self._angles(motion, samples)
            E, to_rates = angular_map(self.axes(motion), angles), rate_map(angles)
            own = w_dot @ self.R - angular_drift(E, rotate(to_rates, w @ self.R))
            caused = np.concatenate([caused, rotate(to_rates, own)], axis=1)
        return self.rate[samples], self.acceleration[samples] - caused[:, self._rows]

    def ahead(self, step: Array) -> CoordinateTarget:
        """Return the target after small times, shape (T,), to second order."""
        s = step[:, None]
        return self._replace(value=self.value + s * self.rate + 0.5 * s * s * self.acceleration)

    def between(self, sample: int, fractions: Array) -> CoordinateTarget:
        """Interpolate the coordinates linearly from a sample to the next, angles by the shorter way."""
        step, angle = self.value[sample + 1] - self.value[sample], self._rows >= 3
        step[angle] = wrapped(step[angle])
        heading = None if self.heading is None else np.full(len(fractions), self.heading[sample])
        return self._replace(value=self.value[sample] + fractions[:, None] * step, heading=heading)

    def from_here(self, motion: Motion, samples: Index) -> CoordinateTarget:
        """Return the way from where the body is now to the given samples."""
        heading = None if self.heading is None else np.repeat(self.heading[samples], 2)
        now = self.coordinates(motion, samples)
        return self._replace(value=in_turn(now, self.value[samples]), heading=heading)

    def headed(self, motion: Motion, samples: Index, *, on: bool = True) -> CoordinateTarget:
        """Return the target with the headings of a motion, each near the one before.

        Without any heading yet, the first is that of the triple with the smaller sum: twice how far its
        prescribed angles go to their first values, and the sizes of its other angles.

        Args:
            motion: Motion at consecutive samples.
            samples: Their indices, shape (n,). The heading before them is that of the first.
            on: Whether all later samples take the last heading.
        """
        if not self.turns:
            return self
        R = self.axes(motion)
        if self.heading is None:
            heading, before = np.zeros(len(self.value)), self._first_heading(R[:1], samples[:1])
        else:
            heading = self.heading.copy()
            before = float(heading[samples[0]])
        heading[samples] = headings_along(R, before)
        if on:
            heading[samples[-1] :] = heading[samples[-1]]
        return self._replace(heading=heading)

    def _first_heading(self, R: Array, sample: Index) -> float:
        """Return the heading of the triple that is meant at a guess of a rotation, shape (1, 3, 3)."""
        angle = self._rows >= 3
        given = self._rows[angle] - 3
        headings = plain_heading(R)[0] + np.array([0.0, np.pi])
        angles = np.stack([angles_of(R[0], heading) for heading in headings])
        way = np.abs(wrapped(angles[:, given] - self.value[sample][:, angle]))
        cost = 2.0 * way.sum(axis=1) + np.abs(np.delete(angles, given, axis=1)).sum(axis=1)
        return float(headings[int(cost[1] + SAME_ANGLE < cost[0])])  # the plainer one if both cost alike

    def headed_at(self, motion: Motion, values: Array) -> CoordinateTarget:
        """Return the target with the heading at each sample of the triple that has given coordinates.

        Args:
            motion: Motion at all samples.
            values: Coordinates there, shape (T, rows), [m, rad]. Where both triples have them, at a pitch of
                a quarter turn, the plainer one counts.
        """
        if not self.turns:
            return self
        plain = plain_heading(self.axes(motion))
        every, angle = np.arange(len(plain)), self._rows >= 3
        near, far = (
            np.abs(wrapped(there.coordinates(motion, every) - values)[:, angle]).max(axis=1)
            for there in (self._replace(heading=plain), self._replace(heading=plain + np.pi))
        )
        return self._replace(heading=np.where(near <= far + SAME_ANGLE, plain, plain + np.pi))


#: Rows that prescribe the motion of one body.
Target = PoseTarget | CoordinateTarget | DirectionTarget | DistanceTarget


def named_rows(target: Target, link: str) -> tuple[str, ...]:
    """Return what each row of a target of a link prescribes, for messages."""
    if isinstance(target, CoordinateTarget):
        return tuple(f"{name} of '{link}'" for name in target.names)
    if isinstance(target, DirectionTarget):
        return (f"the direction of the {COORDINATES[target.axis]} axis of '{link}'",) * 2
    if isinstance(target, DistanceTarget):
        return (f"the distance of '{link}'",)
    place = (f"the position of '{link}'",) * target.lengths
    return (*place, *(f"the orientation of '{link}'",) * 3)


def row_measures(target: Target) -> list[tuple[float, str]]:
    """Return what one is of each scaled row of a target, in metres or radians, for messages."""
    lengths = target.lengths if isinstance(target, PoseTarget) else int(isinstance(target, DistanceTarget))
    metres = [i < lengths for i in range(len(target.units))]
    if isinstance(target, CoordinateTarget):
        metres = [name in COORDINATES[:3] for name in target.names]
    return [(float(unit), "m" if m else "rad") for unit, m in zip(target.units, metres, strict=True)]
