"""Say a closure with the constraints that engines have: coinciding points and welds."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal, NamedTuple

import numpy as np
import pinocchio as pin

from ....description.placement import placement_from
from ....description.records import Closure
from ....spatial import Array
from ....structure.building import rebuilt
from ....structure.robot import HybridRobot

#: Distance of the two points that stand for a hinge from its centre, relative to the robot's size.
HINGE = 0.1
#: Largest cross product of parallel unit vectors.
PARALLEL = 1e-12


class Joining(NamedTuple):
    """A constraint between two links.

    Attributes:
        kind: "point": the origins of the frames coincide. "weld": the frames coincide.
        frame_a: Frame on the closure's first link, shape (4, 4).
        frame_b: Frame on its second link, shape (4, 4).
    """

    kind: Literal["point", "weld"]
    frame_a: Array
    frame_b: Array


def joinings(closure: Closure, size: float) -> list[Joining]:
    """Return the points or the weld that state a closure; none if they cannot.

    A hinge is two points on its axis: six rows, of which five are independent.

    Args:
        size: Size of the robot [m].
    """
    if closure.translations != (0, 1, 2) or closure.rotation == "perpendicular":
        return []
    if closure.rotation == "fixed":
        return [Joining("weld", closure.frame_a, closure.frame_b)]
    out = []
    for shift in (0.0,) if closure.rotation == "free" else (-HINGE * size, HINGE * size):
        way = placement_from(np.eye(3), np.array([0.0, 0.0, shift]))
        out.append(Joining("point", closure.frame_a @ way, closure.frame_b @ way))
    return out


def at_points(robot: HybridRobot) -> HybridRobot:
    """Return a plane robot with its hinges as points: the plane keeps their axes parallel. Others stay."""
    if not planar(robot):
        return robot
    closures = tuple(
        replace(one, kind="spherical", rotation="free")
        if (one.translations, one.rotation) == ((0, 1, 2), "parallel")
        else one
        for one in robot.description.closures
    )
    if closures == robot.description.closures:
        return robot
    return rebuilt(robot, replace(robot.description, closures=closures))


def planar(robot: HybridRobot) -> bool:
    """Tell whether every joint is a hinge and all axes at home are parallel."""
    if set(robot.kinds) - {"revolute", "continuous"}:
        return False
    data = robot.unchanged_model.createData()
    pin.computeJointJacobians(robot.unchanged_model, data, robot.home)
    axes = data.J[3:].T
    return bool(np.abs(np.cross(axes, axes[:1])).max(initial=0.0) < PARALLEL)
