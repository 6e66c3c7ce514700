"""Distance joints of a USD stage: with equal distances they are rods without mass between two balls.

A rod hangs on the first body by two hinges across it, so that it does not spin, and a ball closes its loop.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..mjcf.naming import unique
from ..placement import placement_from, rotation_to_axis
from ..records import Array, Closure, Joint, Link
from ..robot_file import RobotFile
from .bodies import Bodies
from .joints import ends_of
from .stage import Prim

#: Distance of two points at which a rod has no direction, relative to its length.
NO_DIRECTION = 1e-6


@dataclass(frozen=True, eq=False)
class Rod:
    """A distance joint with equal distances.

    Attributes:
        bodies: The two bodies that it joins; None is the world.
        points: Its ends in them, shape (3,), [m].
        length: The distance [m].
    """

    prim: Prim
    bodies: tuple[Prim | None, Prim | None]
    points: tuple[Array, Array]
    length: float

    @property
    def ends(self) -> tuple[str, str]:
        """Paths of its bodies, "" for the world."""
        first, second = (body.path if body else "" for body in self.bodies)
        return first, second


def read_rods(bodies: Bodies, notes: list[str]) -> list[Rod]:
    """Return the distance joints of a stage in file order.

    Args:
        notes: Remarks for the user, to which the joints are added that hold nothing.

    Raises:
        ModelError: A joint allows a range of distances, or is wrong.
    """
    out = []
    for prim in bodies.stage.prims.values():
        if prim.kind != "PhysicsDistanceJoint":
            continue
        if not prim.flag("physics:jointEnabled", True):
            notes.append(f"<{prim.path}> has physics:jointEnabled = false: it is not read")
            continue
        ((first, a), (second, b)) = ends_of(bodies, prim)
        least, most = (prim.any_number(f"physics:{word}Distance", -1.0) for word in ("min", "max"))
        if least < 0 and not 0 <= most < np.inf:
            notes.append(f"<{prim.path}> limits no distance: it is not read")
            continue
        if least != most:
            raise prim.error(
                "a range of distances is an inequality, which is not read; set physics:minDistance and "
                "physics:maxDistance to one value, which is a rod, or remove the joint"
            )
        out.append(Rod(prim, (first, second), (a[:3, 3], b[:3, 3]), most * bodies.stage.meters))
    return out


def add_rod(
    robot: RobotFile,
    bodies: Bodies,
    rod: Rod,
    name: str,
    ends: tuple[str, str],
    taken: tuple[set[str], set[str]],
) -> None:
    """Add a rod to the robot; one without length is a ball.

    Args:
        bodies: The bodies, where they stand in the file.
        ends: Names of the links of its first and second body.
        taken: Names of links and joints, to which those that are made are added.
    """
    at_a, at_b = (placement_from(np.eye(3), point) for point in rod.points)
    parent = ends[0]
    if rod.length:
        first, second = (
            (np.eye(4) if body is None else bodies.pose(body).frame) @ frame
            for body, frame in zip(rod.bodies, (at_a, at_b), strict=True)
        )
        along = first[:3, :3].T @ (second[:3, 3] - first[:3, 3])
        apart = float(np.linalg.norm(along))
        axis = along / apart if apart > NO_DIRECTION * rod.length else np.array([0.0, 0.0, 1.0])
        at = placement_from(rotation_to_axis(axis), rod.points[0])
        for number, across in enumerate(np.eye(3)[:2], 1):
            joint, link = unique(f"{name}_{number}", taken[1]), unique(f"{name}_rod{number}", taken[0])
            taken[0].add(link)
            taken[1].add(joint)
            robot.joints.append(Joint(joint, "revolute", parent, link, at, across))
            robot.links.append(Link(link, 0.0, np.zeros(3), np.zeros((3, 3)), None, True))
            parent, at = link, np.eye(4)
        at_a = placement_from(np.eye(3), np.array([0.0, 0.0, rod.length]))
    robot.closures.append(Closure(name, "spherical", parent, at_a, ends[1], at_b, (0, 1, 2), "free"))
