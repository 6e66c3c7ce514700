"""Compute the poses of a robot's bodies from its posture."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..spatial import Array, compose, rotate, rotation_from_quaternion
from ..structure.robot import HybridRobot
from .picture import BodyPoint, Picture, PictureShape


class Placement(NamedTuple):
    """Poses of all bodies in the world at one posture.

    Attributes:
        R: Orientations of the bodies, shape (bodies, 3, 3).
        p: Origins of the bodies, shape (bodies, 3), [m].
    """

    R: Array
    p: Array

    def at(self, point: BodyPoint) -> Array:
        """Compute the position of a point in the world, shape (3,), [m]."""
        return np.asarray(self.p[point.body] + self.R[point.body] @ point.at)

    def seen_from(self, body: int) -> Placement:
        """Compute the poses of all bodies in the frame of one of them."""
        R = self.R[body]
        return Placement(R.T @ self.R, (self.p - self.p[body]) @ R)

    def of(self, shape: PictureShape) -> Array:
        """Compute the corners of a shape in the world, shape (V, 3), [m]."""
        corners = shape.vertices
        if shape.ends is not None:
            start, end = shape.ends
            corners = stretched(corners, start.at, self.seen_from(start.body).at(end))
        return np.asarray(self.p[shape.body] + corners @ self.R[shape.body].T)


def along(foot: Array, tip: Array) -> tuple[Array, float]:
    """Compute axes with z from a point towards another, shape (3, 3), and how far that is [m]."""
    length = float(np.linalg.norm(tip - foot))
    z = (tip - foot) / length if length else np.array([0.0, 0.0, 1.0])
    x = np.cross([0.0, 0.0, 1.0] if abs(z[2]) < 0.9 else [1.0, 0.0, 0.0], z)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z]), length


def stretched(vertices: Array, foot: Array, tip: Array) -> Array:
    """Compute the corners of a rod between two points, shape (V, 3), from those of one from z = 0 to 1."""
    axes, length = along(foot, tip)
    return np.asarray(foot + vertices * [1.0, 1.0, length] @ axes.T)


def place_bodies(robot: HybridRobot, q: Array) -> Placement:
    """Compute the poses of all bodies in the world at a posture, shape (nq,)."""
    count = len(robot.bodies.bodies)
    R, p = np.zeros((count, 3, 3)), np.zeros((count, 3))
    R[0] = np.eye(3)
    if robot.base != "fixed":
        R[0], p[0] = rotation_from_quaternion(q[3:7]), q[:3]
    for number, module in enumerate(robot.modules):
        if robot.base == "floating" and number == 0:
            continue
        base = robot.bodies.place[module.base][0]
        motion = module.mechanism.spanning.sweep(q[None, module.q_index])
        own = [robot.body_of_joint[joint] for joint in module.joints]
        R[own] = compose(R[base], motion.R[0, 1:])
        p[own] = p[base] + rotate(R[base], motion.p[0, 1:])
    return Placement(R, p)


def extent(picture: Picture, placement: Placement) -> Array:
    """Compute the lower and upper corner of a picture's bounding box in the world, shape (2, 3), [m]."""
    every = np.concatenate([placement.of(shape) for shape in picture.shapes] or [np.zeros((1, 3))])
    return np.stack([every.min(axis=0), every.max(axis=0)])
