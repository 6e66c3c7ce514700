"""Compute the efforts that `hybridyn view` shows along a motion."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..errors import HybridynError

if TYPE_CHECKING:
    from ..description.records import Array
    from ..streams.postures import Postures
    from ..structure.robot import HybridRobot


def efforts_along(
    robot: HybridRobot, file: str, found: Postures, effects: tuple[str, ...]
) -> tuple[Array | None, str]:
    """Return the efforts along a motion: the table's where it has all of them, else the inverse model's.

    Returns:
        Efforts, shape (T, motors), [N or N m], or None; and their origin, or the reason why there are none.
    """
    import numpy as np

    from ..effects import choose
    from ..streams.efforts import efforts_in_blocks
    from ..tables.opening import open_table

    wanted = [f"{motor}/effort" for motor in robot.motors]
    if not wanted:
        return None, "there are no motors"
    with open_table(file) as table:
        if set(wanted) <= set(table.columns):
            at = [table.columns.index(name) for name in wanted]
            return np.concatenate([block.values[:, at] for block in table.blocks]), "of the table"
    motion, q, v, a = found
    try:
        tau = efforts_in_blocks(
            robot, q, v, a, choose(robot, effects), wrenches=motion.wrenches, time=motion.time
        )
    except HybridynError as error:
        return None, f"cannot be had: {str(error).partition('. ')[0]}"
    return tau, "of the inverse model"
