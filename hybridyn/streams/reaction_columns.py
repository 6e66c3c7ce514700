"""Reaction wrenches as columns of a table; `tables.columns` explains each column."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..description.names import listed
from ..spatial import Array
from ..structure.robot import HybridRobot
from ..tables.signals import WRENCH

if TYPE_CHECKING:  # most tables want no reactions
    from ..dynamics.reactions import Reactions


def reaction_columns(robot: HybridRobot) -> list[str]:
    """Return the names of the columns: those of the root, of the modules, of the closures, of the joints."""
    couplings = {coupling.name for coupling in robot.description.couplings}
    bodies, closures = _names(robot)
    out = [f"{name}/reaction/{part}" for name in bodies for part in WRENCH]
    for name in closures:
        out += [f"{name}/multiplier"] if name in couplings else [f"{name}/wrench/{part}" for part in WRENCH]
    return out + [f"{name}/transmitted/{part}" for name in _joints(robot) for part in WRENCH]


def reaction_rows(robot: HybridRobot, reactions: Reactions) -> Array:
    """Return the rows of reactions in the order of `reaction_columns`, shape (T, columns), [N, N m]."""
    bodies, closures = _names(robot)
    of_bodies = {robot.description.root: reactions.base, **reactions.modules}
    return np.hstack(
        [
            *map(of_bodies.__getitem__, bodies),
            *map(reactions.closures.__getitem__, closures),
            *map(reactions.joints.__getitem__, _joints(robot)),
        ]
    )


def shared_wrenches(robot: HybridRobot) -> list[str]:
    """Return a sentence for each module whose closure wrenches are not unique."""
    out = []
    for module in robot.modules:
        spare = module.mechanism.closures.rows - module.mechanism.reduction.rank
        if spare:
            which = listed(module.closures)
            out.append(
                f"wrenches of {which} share {spare} redundant rows: the motion does not determine them, the "
                "least ones are given"
            )
    return out


def _names(robot: HybridRobot) -> tuple[list[str], list[str]]:
    """Return the root link and the modules, and the closures; a free base is a module named as the root."""
    bodies = dict.fromkeys([robot.description.root, *(module.name for module in robot.modules)])
    return [*bodies], [name for module in robot.modules for name in module.closures]


def _joints(robot: HybridRobot) -> list[str]:
    """Return the joints of the modules, module by module."""
    return [name for module in robot.modules for name in module.joints]
