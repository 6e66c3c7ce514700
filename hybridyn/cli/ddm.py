"""`hybridyn ddm`: compute accelerations under motor efforts."""

from functools import partial
from typing import Any

import numpy as np

from ..dynamics.direct import direct_model
from ..effects import Effects, choose
from ..streams.one_pass import BlockResults, Pass
from ..streams.postures import TreeSamples
from ..streams.reaction_columns import reaction_rows
from ..structure.robot import HybridRobot
from ..studies.check.remarks import free_motions_of
from ..tables.columns import acceleration_columns
from ..tables.signals import unit_of
from ..tables.tree_coordinates import base_acceleration
from .common.each_table import for_each_table
from .common.engine_choice import EngineChoice, engine_for_table
from .common.one_table import CommandTables
from .common.options import RobotChoice
from .common.summary import Summary, about
from .common.table_pass import CommandPlan
from .common.table_pass import run as run_pass


def run(**words: Any) -> int:
    """Compute accelerations for each table."""
    return for_each_table(_one, words)


def _one(load: RobotChoice, tables: CommandTables, effects: tuple[str, ...], engine: str | None) -> int:
    def plan(given: Pass) -> CommandPlan:
        """Build the plan for a robot and a table."""
        robot, layout, on = given.robot, given.layout, choose(given.robot, effects)
        reactions = tables.reactions is not None
        chosen = engine_for_table(engine, given, on, {"--reactions": reactions})
        columns = acceleration_columns(robot.description, robot.joints, robot.base)
        units = [unit_of(robot.records[motor].kind, "acceleration") for motor in robot.motors]
        remarks = [*about(robot, layout, on), *free_motions_of(robot)]
        model = partial(accelerations, effects=on, reactions=reactions, engine=chosen)
        return CommandPlan(model, columns, [Summary(robot, "acceleration", units, columns)], chosen, remarks)

    run_pass(tables, load, plan, efforts=True)
    return 0


def accelerations(
    robot: HybridRobot, block: TreeSamples, *, effects: Effects, reactions: bool, engine: EngineChoice
) -> BlockResults:
    """Compute the accelerations of a block as rows of the result, and the reactions if they are wanted.

    Args:
        block: The states; of the accelerations only that of a moving base is used.
        effects: The effects that are computed.
        reactions: Whether reactions are computed.
        engine: What computes.
    """
    given = block.motion.efforts
    tau = np.column_stack([np.zeros((len(block.q), 0)), *(given[name] for name in robot.motors)])
    base = block.a[:, :6] if robot.base == "moving" else None
    inner, residual, handed_over = None, None, 0
    if (compiled := engine.model) is not None:
        before = compiled.recomputed
        a = compiled.ddm(block.q, block.v, tau, base_acceleration=base)
        handed_over = compiled.recomputed - before
    else:
        found = direct_model(
            robot,
            block.q,
            block.v,
            tau,
            base_acceleration=base,
            wrenches=block.motion.wrenches or None,
            effects=effects,
            time=block.motion.time,
            reactions=reactions,
        )
        a, residual = found.values, found.residual
        inner = None if found.reactions is None else reaction_rows(robot, found.reactions)
    rows = a if robot.base == "fixed" else a[:, 6:]
    if robot.base == "floating":
        rows = np.hstack([base_acceleration(block.q, block.v, a), rows])
    return BlockResults(rows, inner, handed_over, residual=residual)
