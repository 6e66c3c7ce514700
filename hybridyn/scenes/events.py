"""Build the events of a scene."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..dynamics.link_motion import link_motions
from ..simulation.events import Event, near_singularity
from ..spatial import Array

if TYPE_CHECKING:
    from ..structure.robot import HybridRobot
    from .scene_file import SceneFile
    from .scene_tables import EventTable

DIRECTIONS = {"rising": 1, "falling": -1, "both": 0}
AXES = ("x", "y", "z")


def events(source: SceneFile, robot: HybridRobot) -> tuple[Event, ...]:
    """Build the events of a scene.

    Raises:
        ModelError: An unknown joint or link, or a joint with several freedoms.
    """
    return tuple(_event(source, robot, i, table) for i, table in enumerate(source.scene.events))


def _event(source: SceneFile, robot: HybridRobot, number: int, table: EventTable) -> Event:
    if table.singularity is not None:
        event = near_singularity(robot, table.at, what=table.singularity, terminal=table.stop)
        return Event(table.title, event.function, -1, table.stop)
    direction = DIRECTIONS[table.direction]
    if table.joint is not None:
        at = _coordinate(source, robot, number, table.joint)
        return Event(table.title, lambda t, q, v: float(q[at]) - table.at, direction, table.stop)
    link, axis = str(table.link), AXES.index(table.axis)
    source.check(("events", number, "link"), "link", link, robot.bodies.place)

    def height(t: float, q: Array, v: Array) -> float:
        """Compute the coordinate of the link's origin, minus the threshold."""
        return (
            float(link_motions(robot, q[None], np.zeros((1, robot.nv)), [link])[link].p[0, axis]) - table.at
        )

    return Event(table.title, height, direction, table.stop)


def _coordinate(source: SceneFile, robot: HybridRobot, number: int, joint: str) -> int:
    """Return the index of a joint's coordinate in q."""
    source.check(("events", number, "joint"), "joint", joint, robot.joints)
    i = robot.joint_index[joint]
    if robot.kinds[i] not in ("revolute", "prismatic"):
        raise source.error(
            ("events", number, "joint"), f"'{joint}' is {robot.kinds[i]}: only revolute and prismatic joints"
        )
    return int(robot.q_slices[i].start)
