"""Compute the poses of a robot's bodies from its posture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..spatial import Array, compose, rotate, rotation_from_quaternion
from ..structure.robot import HybridRobot
from .picture import Picture, Point


class Placement(NamedTuple):
    """Poses of all bodies in the world at one posture.

    Attributes:
        R: Orientations of the bodies, shape (bodies, 3, 3).
        p: Origins of the bodies, shape (bodies, 3), [m].
    """

    R: Array
    p: Array

    def of(self, points: Sequence[Point]) -> Array:
        """Compute the positions of points in the world, shape (len(points), 3), [m]."""
        if not points:
            return np.zeros((0, 3))
        at = np.array([point.body for point in points])
        placed: Array = self.p[at] + rotate(self.R[at], np.array([point.at for point in points]))
        return placed


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
    points = [end for rod in picture.rods for end in (rod.start, rod.end)]
    points += [ball.at for ball in picture.balls]
    corners = [placement.of(points)]
    corners += [s.vertices @ placement.R[s.body].T + placement.p[s.body] for s in picture.solids]
    every = np.concatenate([corner for corner in corners if len(corner)] or [np.zeros((1, 3))])
    return np.stack([every.min(axis=0), every.max(axis=0)])
