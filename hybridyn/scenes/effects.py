"""Build the effects that a scene names, with the scene's own numbers or the robot's, and its events."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..description.effect_names import acts_on, named_by
from ..dynamics.link_motion import link_motions
from ..effects import BaseMotion, Payload, Wrench
from ..effects.catalogue import made
from ..effects.listing import listed_units
from ..simulation.events import Event, near_singularity
from ..spatial import Array
from ..tables.opening import read_columns
from ..tables.signals import POSE, WRENCH
from .toml_source import naming

if TYPE_CHECKING:
    from ..description.side_cars.toml_file import Keys
    from ..structure.robot import HybridRobot
    from .scene_file import EventTable, SceneFile

DIRECTIONS = {"rising": 1, "falling": -1, "both": 0}
AXES = ("x", "y", "z")
LISTS = ("payload", "wrench", "base_motion", "use")


def units(source: SceneFile, robot: HybridRobot) -> list[Any]:
    """Build the effects of a scene; its own numbers replace those of the robot's files.

    Raises:
        ModelError: An unknown effect, joint or link, or invalid numbers.
    """
    tables = source.scene.effects
    use = [tables.use] if isinstance(tables.use, str) else tables.use
    own = {name: values for name, values in tables.stated().items() if name not in LISTS}
    spelled = {*own, *(name for name in LISTS[:3] if getattr(tables, name))}
    words = [word for word in use if word not in spelled]
    with naming(source, ("effects", "use")):
        found = [unit for unit in listed_units(robot, words) if unit.name not in spelled] if words else []
    for name, values in own.items():
        _check_names(source, robot, name, values)
        with naming(source, ("effects", name)):
            found.append(made(name, values))
    return found + _on_links(source, robot) + _base(source, robot)


def _made(source: SceneFile, keys: Keys, kind: type[Any], values: dict[str, Any]) -> Any:
    """Build an effect; its errors name file, line and key."""
    with naming(source, keys):
        return kind(**values)


def _check_names(source: SceneFile, robot: HybridRobot, name: str, values: dict[str, Any]) -> None:
    """Check that the robot has the joints or links that an effect names."""
    what, known = (
        ("link", robot.bodies.place) if acts_on(name) == "link" else ("movable joint", robot.body_of_joint)
    )
    for key, entry in named_by(name, values):
        source.check(("effects", name, key, entry), what, entry, known)


def _on_links(source: SceneFile, robot: HybridRobot) -> list[Any]:
    """Build the payloads and wrenches of a scene."""
    out = []
    for name, kind in (("payload", Payload), ("wrench", Wrench)):
        for i, table in enumerate(getattr(source.scene.effects, name)):
            keys = ("effects", name, i)
            source.check((*keys, "link"), "link", table.link, robot.bodies.place)
            values = table.model_dump(exclude_none=True)
            if "table" in values:
                columns = [f"{table.link}/wrench/{part}" for part in WRENCH]
                rows = read_rows(source, (*keys, "table"), values.pop("table"), columns)
                values |= {"time": rows[:, 0], "wrench": rows[:, 1:]}
            out.append(_made(source, keys, kind, values))
    return out


def _base(source: SceneFile, robot: HybridRobot) -> list[Any]:
    table = source.scene.effects.base_motion
    if table is None:
        return []
    keys = ("effects", "base_motion", "table")
    rows = read_rows(source, keys, table.table, [f"{robot.description.root}/pose/{part}" for part in POSE])
    return [_made(source, keys, BaseMotion, {"time": rows[:, 0], "pose": rows[:, 1:]})]


def read_rows(source: SceneFile, keys: Keys, name: str, columns: list[str]) -> Array:
    """Read columns of a table that a scene names, time first, and check that it covers the scene.

    Returns:
        Shape (rows, 1 + columns).

    Raises:
        ModelError: A column is missing, a cell is wrong, or the table is too short.
    """
    with naming(source, keys):
        rows = read_columns(source.beside(name), ["time", *columns])
    check_covers(source, keys, rows[:, 0])
    return rows


def check_covers(source: SceneFile, keys: Keys, time: Array) -> None:
    """Check that a table covers the duration of the scene.

    Raises:
        ModelError: It does not; the message names the key.
    """
    if time[0] > 0.0 or time[-1] < source.scene.duration:
        raise source.error(
            keys,
            f"the table runs from {time[0]:g} s to {time[-1]:g} s, the scene from 0 to "
            f"{source.scene.duration:g} s",
        )


def events(source: SceneFile, robot: HybridRobot) -> tuple[Event, ...]:
    """Build the events of a scene.

    Raises:
        ModelError: An unknown joint or link, or a joint with several freedoms.
    """
    return tuple(_event(source, robot, i, table) for i, table in enumerate(source.scene.events))


def _event(source: SceneFile, robot: HybridRobot, number: int, table: EventTable) -> Event:
    if table.singularity is not None:
        event = near_singularity(robot, table.at, what=table.singularity, terminal=table.stop)
        return replace(event, name=table.title)
    direction = DIRECTIONS[table.direction]
    if table.joint is not None:
        source.check(("events", number, "joint"), "joint", table.joint, robot.joints)
        i = robot.joint_index[table.joint]
        if not robot.kinds[i].additive:
            raise source.error(
                ("events", number, "joint"),
                f"'{table.joint}' is {robot.kinds[i]}: only revolute and prismatic joints",
            )
        at = int(robot.q_slices[i].start)
        return Event(
            table.title,
            lambda t, q, v: float(q[at]) - table.at,
            direction,
            table.stop,
        )
    link, axis = str(table.link), AXES.index(table.axis)
    source.check(("events", number, "link"), "link", link, robot.bodies.place)

    def height(t: float, q: Array, v: Array) -> float:
        """Compute the coordinate of the link's origin, minus the threshold."""
        return (
            float(link_motions(robot, q[None], np.zeros((1, robot.nv)), [link])[link].p[0, axis]) - table.at
        )

    return Event(table.title, height, direction, table.stop)
