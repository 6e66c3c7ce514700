"""`hybridyn idm`: compute the motor efforts for a motion."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import click

from ..streams.reaction_columns import reaction_rows
from .common.engine import choose_engine, takes_engine, worth_of
from .common.options import RobotCommand, takes_effects
from .common.summary import Summary, branch_line, effects_line, not_computed
from .common.tables import Plan, Tables, run, takes_table

if TYPE_CHECKING:
    from ..compiled.model import CompiledRobot
    from ..effects import Effects
    from ..streams.blocks import Rows
    from ..streams.postures import Postures
    from ..structure.robot import HybridRobot
    from ..tables.columns import Layout


takes_passive = click.option(
    "--passive",
    type=click.Choice(["given", "solved"]),
    default="given",
    show_default=True,
    help="Accelerations of joints without a motor: 'given' in the table, or 'solved' for zero effort.",
)


@click.command(
    "idm", cls=RobotCommand, short_help="Compute motor efforts for a motion (inverse dynamic model)."
)
@takes_table("TRAJECTORY", own=True, plot="the efforts, motors grouped by module")
@takes_passive
@click.option(
    "--on-singular",
    type=click.Choice(["raise", "least-norm"]),
    default="raise",
    show_default=True,
    help="At a singular posture: stop, or compute the smallest efforts.",
)
@click.option(
    "--weights",
    multiple=True,
    help="Weights by which redundant motors share efforts: motor=value for every motor (commas or repeated), "
    "or a CSV file with the motors' names and one row.",
)
@takes_effects("default")
@takes_engine("rows")
def command(
    load: Callable[[], HybridRobot],
    tables: Tables,
    passive: str,
    on_singular: str,
    weights: tuple[str, ...],
    effects: tuple[str, ...],
    engine: str | None,
) -> None:
    """Compute the motor efforts that move ROBOT (URDF, MJCF, SDF, USD) along TRAJECTORY (CSV or Parquet).

    ROBOT may be the name of a shipped robot ('hybridyn --robots'), which has a trajectory of its own.

    The table has named columns, in SI units: 'time', '<joint>/position|velocity|acceleration',
    '<link>/pose/x|y|z|qx|qy|qz|qw' or any of 'x|y|z|roll|pitch|yaw' relative to the root link
    ('<link>@<other>/...': to another link), '<link>/velocity|acceleration/x|y|z|wx|wy|wz',
    '<link>/wrench/fx|fy|fz|mx|my|mz'. It contains the motion of the motors, of platforms, of a mixture of
    both, or of every joint. Missing rates are fitted by a spline over time. docs/tables.md explains all.

    The result has one row per sample, with 'time' and a column '<motor>/effort' per motor.
    """

    def plan(robot: HybridRobot, layout: Layout, rows: int | None) -> Plan:
        """Build the plan for a robot and a table."""
        from ..effects import choose

        shares, chosen = read_weights(weights, robot.motors), choose(robot, effects)
        check_has_mass(robot, chosen, layout)
        obstacles = {
            "--reactions": tables.reactions is not None,
            "--passive solved": passive != "given",
            "--on-singular least-norm": on_singular != "raise",
            "--weights": shares is not None,
            "wrenches in the table": bool(layout.wrenches),
        }
        chosen_engine = choose_engine(engine, robot, chosen, rows, obstacles, worth_of(layout, robot))
        model = functools.partial(
            efforts,
            passive=passive,
            on_singular=on_singular,
            weights=shares,
            effects=chosen,
            reactions=tables.reactions is not None,
            compiled=chosen_engine.model,
        )
        summary = Summary(
            robot,
            "effort",
            list(robot.motors),
            robot.effort_units,
            list(range(len(robot.motors))),
            remarks=[*branch_line(robot, layout), *effects_line(chosen), *not_computed(robot, chosen)],
            engine=chosen_engine,
        )
        assemble = chosen_engine.assemble
        return Plan(model, [f"{name}/effort" for name in robot.motors], summary, assemble=assemble)

    run(tables, load, plan)


def efforts(
    robot: HybridRobot,
    block: Postures,
    *,
    effects: Effects,
    passive: str,
    on_singular: str = "raise",
    weights: Mapping[str, float] | None = None,
    reactions: bool = False,
    compiled: CompiledRobot | None = None,
) -> Rows:
    """Compute the efforts of a block, shape (T, motors), and the reactions if they are wanted.

    Args:
        robot: The robot.
        block: The motion.
        effects: As in `hybridyn.idm`, like the next three.
        passive: Source of the passive joints' accelerations.
        on_singular: Behaviour at singular postures.
        weights: Weights of redundant motors.
        reactions: Whether reactions are computed.
        compiled: The robot's compiled models, or None for the general path.
    """
    from ..dynamics.inverse import inverse_model
    from ..streams.blocks import Rows
    from ..streams.departures import departures

    if compiled is not None:
        before = compiled.recomputed
        tau = compiled.idm(block.q, block.v, block.a)
        left = departures(robot, block.q, block.v, tau)
        again = compiled.recomputed - before
        return Rows(tau, handed_over=again, left=left, residual=compiled.closure_residual(block.q))
    found = inverse_model(
        robot,
        block.q,
        block.v,
        block.a,
        wrenches=block.motion.wrenches or None,
        passive=passive,
        on_singular=on_singular,
        weights=weights,
        effects=effects,
        time=block.motion.time,
        reactions=reactions,
    )
    left = departures(robot, block.q, block.v, found.values)
    inner = None if found.reactions is None else reaction_rows(robot, found.reactions)
    return Rows(found.values, inner, left=left, residual=found.residual)


def check_has_mass(robot: HybridRobot, effects: Effects, layout: Layout) -> None:
    """Check that efforts are not all zero for lack of mass.

    Raises:
        ModelError: No link has mass, and neither effects nor the table's wrenches need an effort.
    """
    from ..description.weightless import has_mass
    from ..effects.choice import DEFAULT, FROM_FILES, stated_names
    from ..errors import ModelError

    idle = {*DEFAULT, *FROM_FILES, "limits"} - set(stated_names(robot))
    loaded = bool(layout.wrenches) or not set(effects.names) <= idle
    if robot.motors and not loaded and not has_mass(robot.description):
        raise ModelError(
            "nothing has mass, so that every effort would be zero: give the links an <inertial>",
            file=robot.description.source,
        )


def read_weights(words: tuple[str, ...], motors: Sequence[str]) -> dict[str, float] | None:
    """Read the motors' weights from `motor=value` words or from a table.

    Returns:
        Weights by motor, or None where none are given; `hybridyn.idm` checks that they are complete.

    Raises:
        click.UsageError: A word is neither `motor=value` nor a file, or a motor is unknown.
    """
    from ..description.names import did_you_mean
    from ..tables.opening import open_table

    weights: dict[str, float] = {}
    for word in words:
        if "=" not in word:
            with open_table(word) as table:
                weights |= dict(zip(table.columns, next(table.blocks).values[0].tolist(), strict=True))
            continue
        for part in word.split(","):
            name, _, number = part.rpartition("=")
            try:
                weights[name.strip()] = float(number)
            except ValueError:
                raise click.UsageError(f"--weights: '{part}' is not of the form motor=value") from None
    for name in weights:
        if name not in motors:
            raise click.UsageError(f"--weights: there is no motor '{name}'{did_you_mean(name, motors)}")
    return weights or None
