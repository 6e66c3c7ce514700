"""Prescribed poses of bodies of a tree, complete or partial, as rows of a Newton problem.

The coordinates of a partial pose are x, y, z of the body's origin and roll, pitch, yaw (URDF's: R = Rz(yaw)
Ry(pitch) Rx(roll)) in the base of the tree. Any N of them are the paper's v_r of a module with N freedoms.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..spatial import Array, Index, cross, hat, rotation_from_vector, rotation_vector
from .tree import Motion, Tree

COORDINATES = ("x", "y", "z", "roll", "pitch", "yaw")


class PoseTarget(NamedTuple):
    """A body's complete pose in the base of its tree.

    Attributes:
        body: Number of the body.
        goal: Its prescribed motion in the base of the tree, T samples.
        units: Unit of each row, shape (6,): the module's length, then one radian.
    """

    body: int
    goal: Motion
    units: Array

    def residual(self, motion: Motion, samples: Index) -> Array:
        """Compute the actual minus the prescribed pose, shape (T, 6), base axes."""
        wanted = self.goal.R[samples]
        turn = rotation_vector(np.matmul(motion.R[:, self.body], np.swapaxes(wanted, 1, 2)))
        return np.concatenate([motion.p[:, self.body] - self.goal.p[samples], turn], axis=1)

    def point(self, motion: Motion) -> tuple[Array, Array, list[int]]:
        """Return where the body is, shape (T, 3), and the axes, shape (3, 3), of these rows."""
        return motion.p[:, self.body], np.eye(3), [0, 1, 2]

    def matrix(self, tree: Tree, motion: Motion) -> Array:
        """Return the rows over the rates, shape (T, 6, nv)."""
        return tree.jacobian(motion, self.body)

    def rates(self, motion: Motion, samples: Index) -> tuple[Array, Array]:
        """Compute prescribed velocities, and prescribed accelerations minus the drift, shapes (T, 6)."""
        bias = np.concatenate([motion.p_ddot[:, self.body], motion.w_dot[:, self.body]], axis=1)
        velocity = np.concatenate([self.goal.p_dot, self.goal.w], axis=1)
        acceleration = np.concatenate([self.goal.p_ddot, self.goal.w_dot], axis=1)
        return velocity[samples], acceleration[samples] - bias

    def between(self, sample: int, fractions: Array) -> PoseTarget:
        """Interpolate from a sample to the next: linear position, rotation about a fixed axis."""
        (R0, R1), (p0, p1) = self.goal.R[sample : sample + 2], self.goal.p[sample : sample + 2]
        turn = rotation_from_vector(fractions[:, None] * rotation_vector(R0.T @ R1))
        p = p0 + fractions[:, None] * (p1 - p0)
        return self._replace(goal=Motion.at_rest(len(p), R0 @ turn, p))

    def from_here(self, motion: Motion, samples: Index) -> PoseTarget:
        """Return the way from where the body is now to the given samples."""
        here, there = motion.of_body(self.body), self.goal.take(samples)
        return self._replace(goal=Motion(*map(pairwise, here.arrays, there.arrays)))


class CoordinateTarget(NamedTuple):
    """Some coordinates of a body's pose in the base of its tree.

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

    def _rows(self) -> list[int]:
        """Return the indices of the coordinates in `COORDINATES`."""
        return [COORDINATES.index(name) for name in self.names]

    def _frame(self, motion: Motion) -> tuple[Array, Array, Array]:
        """Compute the link's axes and origin in the reference, and its offset in the body, base axes."""
        R = motion.R[:, self.body]
        offset = np.matmul(R, self.shift[1])
        p = motion.p[:, self.body] + offset
        return np.matmul(self.R.T, np.matmul(R, self.shift[0])), (p - self.p) @ self.R, offset

    def residual(self, motion: Motion, samples: Index) -> Array:
        """Compute actual minus prescribed coordinates, shape (T, rows); angles wrapped to half a turn."""
        R, p, _ = self._frame(motion)
        rows = np.array(self._rows())
        angle = rows >= 3
        there = np.concatenate([p, roll_pitch_yaw(R)], axis=1) if angle.any() else p
        out: Array = there[:, rows] - self.value[samples]
        out[:, angle] -= 2 * np.pi * np.round(out[:, angle] / (2 * np.pi))
        return out

    def point(self, motion: Motion) -> tuple[Array, Array, list[int]]:
        """Return where the link is, shape (T, 3), and the axes, shape (k, 3), of the rows of lengths."""
        offset = self._frame(motion)[2]
        rows = [i for i, coordinate in enumerate(self._rows()) if coordinate < 3]
        return motion.p[:, self.body] + offset, self.R.T[np.array(self._rows())[rows]], rows

    def matrix(self, tree: Tree, motion: Motion) -> Array:
        """Return the rows over the rates, shape (T, rows, nv)."""
        R, _, offset = self._frame(motion)
        J = tree.jacobian(motion, self.body)
        out: Array = np.matmul(self.R.T, J[:, :3] - np.matmul(hat(offset), J[:, 3:]))
        if max(self._rows()) >= 3:
            turned = np.concatenate([out, np.matmul(self.R.T, J[:, 3:])], axis=1)
            out = np.matmul(_coordinate_map(R), turned)
        return out[:, self._rows()]

    def rates(self, motion: Motion, samples: Index) -> tuple[Array, Array]:
        """Compute prescribed rates, and prescribed accelerations minus the drift, shapes (T, rows)."""
        R, _, offset = self._frame(motion)
        w, w_dot = motion.w[:, self.body], motion.w_dot[:, self.body]
        velocity = motion.p_dot[:, self.body] + cross(w, offset)
        bias = motion.p_ddot[:, self.body] + cross(w_dot, offset) + cross(w, cross(w, offset))
        twist = np.concatenate([velocity @ self.R, w @ self.R], axis=1)
        accel = np.concatenate([bias @ self.R, w_dot @ self.R], axis=1)
        caused = np.matmul(_coordinate_map(R), accel[..., None])[..., 0] + _coordinate_drift(R, twist)
        return self.rate[samples], self.acceleration[samples] - caused[:, self._rows()]

    def between(self, sample: int, fractions: Array) -> CoordinateTarget:
        """Interpolate the coordinates linearly from a sample to the next, angles by the shorter way."""
        step = self.value[sample + 1] - self.value[sample]
        angle = np.array(self._rows()) >= 3
        step[angle] -= 2 * np.pi * np.round(step[angle] / (2 * np.pi))
        return self._replace(value=self.value[sample] + fractions[:, None] * step)

    def from_here(self, motion: Motion, samples: Index) -> CoordinateTarget:
        """Return the way from where the body is now to the given samples."""
        now = self.residual(motion, samples) + self.value[samples]
        return self._replace(value=pairwise(now, self.value[samples]))


#: Rows that prescribe the motion of one body.
Target = PoseTarget | CoordinateTarget


def pairwise(here: Array, there: Array) -> Array:
    """Return the rows of two arrays, shape (n, ...), in turn, shape (2 n, ...)."""
    return np.stack([here, there], axis=1).reshape(-1, *here.shape[1:])


def roll_pitch_yaw(R: Array) -> Array:
    """Compute roll, pitch and yaw of rotations (..., 3, 3), in URDF's convention."""
    pitch = np.arctan2(-R[..., 2, 0], np.hypot(R[..., 0, 0], R[..., 1, 0]))
    roll, yaw = np.arctan2(R[..., 2, 1], R[..., 2, 2]), np.arctan2(R[..., 1, 0], R[..., 0, 0])
    return np.stack([roll, pitch, yaw], -1)


def _euler_map(R: Array) -> Array:
    """Compute the map from rates of roll, pitch, yaw to angular velocity, shape (T, 3, 3).

    Its columns are the axes of the three turns: of the body, of the line of nodes, and of the reference.
    """
    yaw = roll_pitch_yaw(R)[:, 2]
    E = np.zeros_like(R)
    E[:, :, 0], E[:, 2, 2] = R[:, :, 0], 1.0
    E[:, 0, 1], E[:, 1, 1] = -np.sin(yaw), np.cos(yaw)
    return E


def _coordinate_map(R: Array) -> Array:
    """Compute the map from velocity and angular velocity to rates of the coordinates, shape (T, 6, 6)."""
    out = np.zeros((len(R), 6, 6))
    out[:, :3, :3] = np.eye(3)
    out[:, 3:, 3:] = np.linalg.pinv(_euler_map(R))
    return out


def _coordinate_drift(R: Array, twist: Array) -> Array:
    """Compute the coordinates' accelerations at zero acceleration of the body, shape (T, 6)."""
    E = _euler_map(R)
    E_inv = np.linalg.pinv(E)
    rates = np.matmul(E_inv, twist[:, 3:, None])[..., 0]
    roll, pitch, yaw = (E[:, :, i] * rates[:, i, None] for i in range(3))
    # The line of nodes turns with yaw, the body's axis with pitch, too.
    drift = -np.matmul(E_inv, (cross(yaw, roll + pitch) + cross(pitch, roll))[..., None])[..., 0]
    return np.concatenate([np.zeros_like(drift), drift], axis=1)
