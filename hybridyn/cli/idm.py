"""`hybridyn idm`: compute the motor efforts for a motion, and what they say of motors and effects."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import click

from ..streams.reaction_columns import reaction_rows
from .common.engine import choose_engine, takes_engine, worth_of
from .common.options import RobotChoice, numbers_by_name, split_names, takes_effects
from .common.summary import Summary, branch_line, effects_line, not_computed
from .common.tables import Observer, Plan, TableCommand, Tables, run

if TYPE_CHECKING:
    from ..compiled.model import CompiledRobot
    from ..effects import Effects
    from ..streams.one_pass import Pass, Rows
    from ..streams.postures import Postures
    from ..structure.robot import HybridRobot
    from ..tables.columns import Layout

#: Exit status where the motion exceeds a limit.
EXCEEDED = 1


class Asked(NamedTuple):
    """What the user asks of a table: the options of the command."""

    tables: Tables
    loads: bool
    outputs: list[str] | None
    effects: tuple[str, ...]
    passive: str
    on_singular: str
    weights: dict[str, float] | None
    engine: str | None


def _part(ctx: click.Context, param: click.Parameter, value: str | None) -> float | None:
    """Parse "1%" or "0.01"."""
    if value is None:
        return None
    try:
        number = float(value[:-1]) / 100 if value.endswith("%") else float(value)
    except ValueError:
        number = -1.0
    if not 0 <= number < float("inf"):
        raise click.BadParameter(
            f"'{value}' is neither a percentage like '1%' nor a number like '0.01'", ctx, param
        )
    return number


def _weights(ctx: click.Context, param: click.Parameter, values: tuple[str, ...]) -> dict[str, float] | None:
    """Read weights from words MOTOR=NUMBER and from tables; None where none are given."""
    if not values:
        return None
    from ..tables.opening import open_table  # completion, which checks no values, must be quick

    weights = numbers_by_name(ctx, param, tuple(word for word in values if "=" in word))
    for file in (word for word in values if "=" not in word):
        with open_table(file) as table:
            weights |= dict(zip(table.columns, next(table.blocks).values[0].tolist(), strict=True))
    return weights


@click.command(
    "idm",
    cls=TableCommand,
    metavar="TRAJECTORY",
    own=True,
    reports=("loads", "by_effect"),
    plot="the result",
    short_help="Compute motor efforts for a motion (inverse dynamic model), and size motors.",
)
@click.option("--loads", is_flag=True, help="Tell what the motion requires of each motor.")
@click.option("--by-effect", is_flag=True, help="Tell what each effect adds to the efforts.")
@click.option(
    "--map",
    "outputs",
    metavar="A,B,...",
    callback=split_names,
    help="Output joints: add their motion, efforts and map.",
)
@takes_effects(None)
@click.option(
    "--passive",
    type=click.Choice(["given", "solved"]),
    default="given",
    show_default=True,
    help="Accelerations of joints without a motor.",
)
@click.option(
    "--on-singular",
    type=click.Choice(["raise", "least-norm"]),
    metavar="raise|least-norm",
    default="raise",
    show_default=True,
    help="What to do at a singular posture.",
)
@click.option(
    "--weights",
    metavar="MOTOR=X,...",
    multiple=True,
    callback=_weights,
    help="Weights of redundant motors, or a CSV file of them.",
)
@click.option(
    "--fail-on",
    type=click.Choice(["limit", "never"]),
    help="Exit with status 1 beyond a limit, or never.  [default: limit with --loads, else never]",
)
@click.option(
    "--within",
    metavar="PART",
    callback=_part,
    help="With --by-effect: effects needed for a part, as 1%.",
)
@takes_engine
def command(
    load: RobotChoice,
    tables: Tables,
    loads: bool,
    by_effect: bool,
    outputs: list[str] | None,
    effects: tuple[str, ...] | None,
    passive: str,
    on_singular: str,
    weights: dict[str, float] | None,
    fail_on: str | None,
    within: float | None,
    engine: str | None,
) -> int:
    """Compute the motor efforts that move ROBOT (URDF, MJCF, SDF, USD) along TRAJECTORY (CSV or Parquet).

    ROBOT may be the name of a shipped robot ('hybridyn --robots'), which has a trajectory of its own.

    The table has named columns, in SI units, such as 'time', '<joint>/position', '<link>/pose/x' or
    '<link>/wrench/fx' (docs/tables.md): the motion of motors, of platforms, of both, or of every joint.
    Missing rates are fitted by a spline. The result has a row per sample, and '<motor>/effort'. With --loads
    it is peak and RMS effort, speed, power and energy of each motor; with --by-effect, what each effect adds.
    """
    if loads + by_effect + bool(outputs) > 1:
        raise click.UsageError("--loads, --by-effect and --map exclude each other")
    if (loads or by_effect) and tables.reactions:
        raise click.UsageError("--reactions belongs to a table of efforts")
    if within is not None and not by_effect:
        raise click.UsageError("--within belongs to --by-effect")
    wanted = effects or (("model",) if loads or by_effect else ("default",))
    if by_effect:
        if weights or passive != "given" or on_singular != "raise":
            raise click.UsageError("--passive, --on-singular and --weights do not apply to --by-effect")
        from .common.by_effect import tell_effects

        tell_effects(load, tables, wanted, engine, within)
        return 0

    asked = Asked(tables, loads, outputs, wanted, passive, on_singular, weights, engine)
    planned = run(tables, load, partial(_plan, asked), outputs=outputs or ())
    fails = (fail_on or ("limit" if loads else "never")) == "limit"
    return EXCEEDED if fails and any(one.exceeded for one in planned.observers) else 0


def _plan(asked: Asked, given: Pass) -> Plan:
    """Build the plan for a robot and a table."""
    from ..description.names import did_you_mean
    from ..effects import choose

    robot, layout = given.robot, given.layout
    on = choose(robot, asked.effects)
    for name in asked.weights or ():
        if name not in robot.motors:
            raise click.UsageError(f"--weights: there is no motor '{name}'{did_you_mean(name, robot.motors)}")
    if asked.loads:  # the report names the limits
        on = on.only([name for name in on.names if name != "limits"])
    if not asked.outputs or on.names:
        check_has_mass(robot, on, layout)
    obstacles = {
        "--reactions": asked.tables.reactions is not None,
        "--passive solved": asked.passive != "given",
        "--on-singular least-norm": asked.on_singular != "raise",
        "--weights": asked.weights is not None,
        "wrenches in the table": bool(layout.wrenches),
    }
    chosen = choose_engine(asked.engine, robot, on, given.table.rows, obstacles, worth_of(layout, robot))
    model = partial(
        efforts,
        passive=asked.passive,
        on_singular=asked.on_singular,
        weights=asked.weights,
        effects=on,
        reactions=asked.tables.reactions is not None,
        compiled=chosen.model,
    )
    if asked.loads:
        from .common.loads import Loads, motor_states

        report = Loads(robot, asked.tables, on, chosen)
        return Plan(partial(motor_states, efforts=model), [], [report], False, chosen.assemble)
    columns = [f"{name}/effort" for name in robot.motors]
    observers: list[Observer] = []
    if asked.outputs:
        from ..studies.map_table import map_columns
        from .common.maps import MapSummary, map_rows

        columns = map_columns(robot, asked.outputs, motion=True, efforts=bool(on.names))
        model = partial(map_rows, joints=asked.outputs, efforts=model if on.names else None)
        observers.append(MapSummary(robot, asked.outputs))
    remarks = [*branch_line(robot, layout), *effects_line(on), *not_computed(robot, on)]
    observers.append(Summary(robot, "effort", robot.effort_units, columns, remarks=remarks, engine=chosen))
    return Plan(model, columns, observers, assemble=chosen.assemble)


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
    from ..streams.departures import departures
    from ..streams.one_pass import Rows

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
    from ..description.loop_signs import has_mass
    from ..effects.choice import DEFAULT, FROM_FILES, stated_names
    from ..errors import ModelError

    idle = {*DEFAULT, *FROM_FILES, "limits"} - set(stated_names(robot))
    loaded = bool(layout.wrenches) or not set(effects.names) <= idle
    if robot.motors and not loaded and not has_mass(robot.description):
        raise ModelError(
            "nothing has mass, so that every effort would be zero: give the links an <inertial>",
            file=robot.description.source,
        )
