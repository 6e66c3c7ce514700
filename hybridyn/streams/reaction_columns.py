"""Reaction wrenches as columns of a table; `tables.columns` explains each column."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..description.records import Array
    from ..dynamics.reactions import Reactions
    from ..structure.robot import HybridRobot


def reaction_columns(robot: HybridRobot) -> list[str]:
    """Return the names of the columns: those of the root, of the modules, of the closures."""
    from ..tables.signals import WRENCH

    couplings = {coupling.name for coupling in robot.description.couplings}
    out = []
    for name in _bodies(robot):
        out += [f"{name}/reaction/{part}" for part in WRENCH]
    for name in _closures(robot):
        out += [f"{name}/multiplier"] if name in couplings else [f"{name}/wrench/{part}" for part in WRENCH]
    return out


def reaction_rows(robot: HybridRobot, reactions: Reactions) -> Array:
    """Return the rows of reactions in the order of `reaction_columns`, shape (T, columns), [N, N m]."""
    import numpy as np

    bodies = {robot.description.root: reactions.base, **reactions.modules}
    parts = [bodies[name] for name in _bodies(robot)]
    return np.hstack([*parts, *(reactions.closures[name] for name in _closures(robot))])


def shared_wrenches(robot: HybridRobot) -> list[str]:
    """Return a sentence for each module whose closure wrenches are not unique."""
    from ..description.names import listed

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


def _bodies(robot: HybridRobot) -> list[str]:
    """Return the root link and the modules by name; a free base is a module with the root link's name."""
    return list(dict.fromkeys([robot.description.root, *(module.name for module in robot.modules)]))


def _closures(robot: HybridRobot) -> list[str]:
    return [name for module in robot.modules for name in module.closures]
