"""Measures of many designs at once, from the table of a compiled robot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from ...description.records import Description, Joint
from ...spatial import Array, Index
from ...streams.postures import TreeSamples
from ...structure.robot import HybridRobot
from ...tables.trajectory import TableMotion
from ..sizing import Sizing, motor_rows
from .measures import OF_MOTORS, measured, of_motors

if TYPE_CHECKING:
    from ...compiled import DesignTable


def measures_of(
    robot: HybridRobot,
    descriptions: Sequence[Description],
    wanted: Mapping[str, str],
    motion: TableMotion,
    table: DesignTable,
    chosen: Index,
) -> list[dict[str, float] | None]:
    """Compute the measures of designs that can make the whole motion.

    A design's measures do not depend on the others.

    Args:
        robot: The robot whose models were compiled.
        descriptions: Description of each chosen design, of which limits are read.
        wanted: The measures by name; none is a function in Python.
        table: Motions and efforts of designs.
        chosen: Numbers of the chosen designs in the table.

    Returns:
        Measures of each chosen design by name; None where a column cannot be computed.
    """
    motors = {name: word for name, word in wanted.items() if word in OF_MOTORS}
    others = {name: word for name, word in wanted.items() if word not in OF_MOTORS}
    out: list[dict[str, float] | None] = [{} for _ in chosen]
    if motors:
        out = [*_loads(robot, descriptions, motors, motion, table, chosen)]
    for i, k in enumerate(chosen.tolist() if others else ()):
        built = replace(robot, description=descriptions[i])
        block = TreeSamples(motion, table.q[k], table.v[k], table.a[k])
        try:
            out[i] = {**(out[i] or {}), **measured(built, others, [(block, table.tau[k])], {})}
        except Exception:  # the general path says what is wrong
            out[i] = None
    return out


def _loads(
    robot: HybridRobot,
    descriptions: Sequence[Description],
    words: Mapping[str, str],
    motion: TableMotion,
    table: DesignTable,
    chosen: Index,
) -> list[dict[str, float]]:
    """Compute measures of motors, which stand side by side, those of a design together."""
    records: dict[int, list[Joint]] = {}
    joints = []
    for description in descriptions:
        if id(description) not in records:
            by_name = {joint.name: joint for joint in description.joints}
            records[id(description)] = [by_name[name] for name in robot.motors]
        joints += records[id(description)]
    sizing = Sizing(robot, joints)
    position, speed = motor_rows(robot, table.q[chosen], table.v[chosen])
    sizing.add(motion.time, motion.first_row, *map(_aside, (position, speed, table.tau[chosen])))
    loads, count = sizing.loads(), len(robot.motors)
    own = [loads[i : i + count] for i in range(0, len(loads), count)]
    return [{name: of_motors(word, each) for name, word in words.items()} for each in own]


def _aside(x: Array) -> Array:
    """Return rows of designs, shape (designs, T, motors), side by side, shape (T, designs x motors)."""
    return x.swapaxes(0, 1).reshape(x.shape[1], -1)
