"""`hybridyn ddm`: compute accelerations under motor efforts."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import click

from .common.engine import choose_engine, takes_engine, worth_of
from .common.options import RobotChoice, takes_effects
from .common.summary import Summary, branch_line, effects_line, not_computed
from .common.tables import Plan, TableCommand, Tables, run

if TYPE_CHECKING:
    from ..compiled.model import CompiledRobot
    from ..effects import Effects
    from ..streams.one_pass import Pass, Rows
    from ..streams.postures import Postures
    from ..structure.robot import HybridRobot


@click.command(
    "ddm",
    cls=TableCommand,
    metavar="STATES",
    plot="the motors' accelerations, grouped by module",
    short_help="Compute accelerations from efforts (direct dynamic model).",
)
@takes_effects("default")
@takes_engine
def command(load: RobotChoice, tables: Tables, effects: tuple[str, ...], engine: str | None) -> None:
    """Compute the accelerations of ROBOT (URDF, MJCF, SDF, USD) for the states and efforts in STATES.

    The table has named columns, in SI units (docs/tables.md): '<motor>/effort' for every motor; 'time';
    positions and velocities of every joint, or of the motors or platforms, from which the state is assembled;
    wrenches on links. With '--base moving' the table also has the base's acceleration,
    '<root link>/acceleration/x|y|z|wx|wy|wz'; other accelerations are not read. Missing velocities are fitted
    by a spline.

    The result has a row per sample, with '<joint>/acceleration' for every joint, and
    '<root link>/acceleration/x' .. 'wz' for a floating base.
    """

    def plan(given: Pass) -> Plan:
        """Build the plan for a robot and a table."""
        from ..effects import choose
        from ..studies.check.remarks import free_motions_of
        from ..tables.columns import acceleration_columns
        from ..tables.signals import unit_of

        robot, layout, on = given.robot, given.layout, choose(given.robot, effects)
        obstacles = {
            "--reactions": tables.reactions is not None,
            "wrenches in the table": bool(layout.wrenches),
        }
        chosen = choose_engine(engine, robot, on, given.table.rows, obstacles, worth_of(layout, robot))
        columns = acceleration_columns(robot.description, robot.joints, robot.base)
        units = [unit_of(robot.records[motor].kind, "acceleration") for motor in robot.motors]
        remarks = [*branch_line(robot, layout), *effects_line(on), *not_computed(robot, on)]
        remarks += free_motions_of(robot)
        summary = Summary(robot, "acceleration", units, columns, remarks=remarks, engine=chosen)
        reactions = tables.reactions is not None
        model = partial(accelerations, effects=on, reactions=reactions, compiled=chosen.model)
        return Plan(model, columns, [summary], assemble=chosen.assemble)

    run(tables, load, plan, efforts=True)


def accelerations(
    robot: HybridRobot,
    block: Postures,
    *,
    effects: Effects,
    reactions: bool,
    compiled: CompiledRobot | None = None,
) -> Rows:
    """Compute the accelerations of a block as rows of the result, and the reactions if they are wanted.

    Args:
        block: The states; of the accelerations only that of a moving base is used.
        effects: The effects that are computed.
        reactions: Whether reactions are computed.
        compiled: The robot's compiled models, or None for the general path.
    """
    import numpy as np

    from ..dynamics.direct import direct_model
    from ..streams.one_pass import Rows
    from ..streams.reaction_columns import reaction_rows
    from ..tables.trajectory import base_acceleration

    given = block.motion.efforts
    tau = (
        np.column_stack([given[name] for name in robot.motors])
        if robot.motors
        else np.zeros((len(block.q), 0))
    )
    base = block.a[:, :6] if robot.base == "moving" else None
    inner, residual, handed_over = None, None, 0
    if compiled is not None:
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
    return Rows(rows, inner, handed_over, residual=residual)
