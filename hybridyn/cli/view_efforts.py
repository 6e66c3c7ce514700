"""Compute the efforts that `hybridyn view` shows along a motion."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from ..errors import HybridynError

if TYPE_CHECKING:
    from ..description.records import Array
    from ..streams.postures import Postures
    from ..structure.robot import HybridRobot


def efforts_along(
    robot: HybridRobot, file: str, found: Sequence[Postures], effects: tuple[str, ...]
) -> tuple[Array | None, str]:
    """Return the efforts along a motion: the table's where it has all of them, else the inverse model's.

    Returns:
        Efforts, shape (T, motors), [N or N m], or None; and their origin, or the reason why there are none.
    """
    import numpy as np

    import hybridyn

    from ..effects import choose
    from ..tables.opening import open_table

    wanted = [f"{motor}/effort" for motor in robot.motors]
    if not wanted:
        return None, "there are no motors"
    with open_table(file) as table:
        if set(wanted) <= set(table.columns):
            at = [table.columns.index(name) for name in wanted]
            return np.concatenate([block.values[:, at] for block in table.blocks]), "of the table"
    chosen = choose(robot, effects)
    parts = []
    for block in found:
        wrenches = block.motion.wrenches or None
        try:
            tau = hybridyn.idm(
                robot,
                block.q,
                block.v,
                block.a,
                wrenches=wrenches,
                effects=chosen,
                time=block.motion.time,
            )
        except HybridynError as error:
            return None, f"cannot be had: {str(error).partition('. ')[0]}"
        parts.append(tau)
    return np.concatenate(parts), "of the inverse model"
