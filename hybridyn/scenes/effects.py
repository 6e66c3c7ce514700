"""Build the effects that a scene names, with the scene's own numbers or the robot's."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..effects import UNITS, BaseMotion, Payload, Wrench
from ..effects.choice import listed_units
from ..spatial import Array
from ..tables.opening import read_columns
from ..tables.signals import POSE, WRENCH
from .toml_source import naming

if TYPE_CHECKING:
    from ..description.side_cars.toml_file import Keys
    from ..structure.robot import HybridRobot
    from .scene_file import SceneFile

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
        found.append(_made(source, ("effects", name), UNITS[name], values))
    return found + _payloads(source, robot) + _wrenches(source, robot) + _base(source, robot)


def _made(source: SceneFile, keys: Keys, kind: type[Any], values: dict[str, Any]) -> Any:
    """Build an effect; its errors name file, line and key."""
    with naming(source, keys):
        return kind(**values)


def _check_names(source: SceneFile, robot: HybridRobot, name: str, values: dict[str, Any]) -> None:
    """Check that the robot has the joints or links that an effect names."""
    points = name == "ground_contact"
    known = robot.bodies.place if points else robot.body_of_joint
    for key, numbers in values.items():
        for entry in numbers if isinstance(numbers, dict) else ():
            what = "link" if points else "movable joint"
            source.check(("effects", name, key, entry), what, entry, known)


def _payloads(source: SceneFile, robot: HybridRobot) -> list[Any]:
    out = []
    for i, table in enumerate(source.scene.effects.payload):
        source.check(("effects", "payload", i, "link"), "link", table.link, robot.bodies.place)
        values = table.model_dump(exclude_none=True)
        out.append(_made(source, ("effects", "payload", i), Payload, values))
    return out


def _wrenches(source: SceneFile, robot: HybridRobot) -> list[Any]:
    out = []
    for i, table in enumerate(source.scene.effects.wrench):
        source.check(("effects", "wrench", i, "link"), "link", table.link, robot.bodies.place)
        values: dict[str, Any] = {"link": table.link, "frame": table.frame, "wrench": table.wrench}
        if table.table is not None:
            rows = read_rows(source, ("effects", "wrench", i, "table"), table.table,
                             [f"{table.link}/wrench/{part}" for part in WRENCH])  # fmt: skip
            values |= {"time": rows[:, 0], "wrench": rows[:, 1:]}
        out.append(_made(source, ("effects", "wrench", i), Wrench, values))
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
