"""`hybridyn idm`: compute the motor efforts for a motion, and what they say of motors and effects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import click

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
    callback=numbers_by_name,
    help="Weights of redundant motors.",
)
@click.option(
    "--fail-on",
    type=click.Choice(["limit", "never"]),
    help="Exit with status 1 beyond a limit, or never.  [default: limit with --loads, else never]",
)
@takes_engine
def command(
    load: RobotChoice,
    tables: Tables,
    loads: bool,
    by_effect: bool,
    outputs: list[str] | None,
    effects: tuple[str, ...] | None,
    fail_on: str | None,
    engine: str | None,
    **model: Any,
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
    wanted = effects or (("model",) if loads or by_effect else ("default",))
    if by_effect:
        if model != {"weights": {}, "passive": "given", "on_singular": "raise"}:
            raise click.UsageError("--passive, --on-singular and --weights do not apply to --by-effect")
        from .common.reports import tell_effects

        tell_effects(load, tables, wanted, engine)
        return 0

    plan = partial(
        _plan, tables=tables, loads=loads, outputs=outputs or (), wanted=wanted, engine=engine, model=model
    )
    planned = run(tables, load, plan, outputs=outputs or ())
    fails = (fail_on or ("limit" if loads else "never")) == "limit"
    return EXCEEDED if fails and any(one.exceeded for one in planned.observers) else 0


def _plan(
    given: Pass, *, tables: Tables, loads: bool, outputs: Sequence[str], wanted: tuple[str, ...],
    engine: str | None, model: dict[str, Any],
) -> Plan:  # fmt: skip
    """Build the plan for a robot and a table from the options of the command."""
    from ..description.names import did_you_mean
    from ..effects import choose

    robot, layout = given.robot, given.layout
    on = choose(robot, wanted)
    for name in model["weights"]:
        if name not in robot.motors:
            raise click.UsageError(f"--weights: there is no motor '{name}'{did_you_mean(name, robot.motors)}")
    if loads:  # the report names the limits
        on = on.only([name for name in on.names if name != "limits"])
    if not outputs or on.names:
        check_has_mass(robot, on, layout)
    reactions = tables.reactions is not None
    obstacles = {
        "--reactions": reactions,
        "--passive solved": model["passive"] != "given",
        "--on-singular least-norm": model["on_singular"] != "raise",
        "--weights": bool(model["weights"]),
        "wrenches in the table": bool(layout.wrenches),
    }
    chosen = choose_engine(engine, robot, on, given.table.rows, obstacles, worth_of(layout, robot))
    inverse = partial(efforts, effects=on, reactions=reactions, compiled=chosen.model, **model)
    if loads:
        from .common.reports import Loads, motor_states

        report = Loads(robot, tables, on, chosen)
        return Plan(partial(motor_states, efforts=inverse), [], [report], False, chosen.assemble)
    columns = [f"{name}/effort" for name in robot.motors]
    observers: list[Observer] = []
    if outputs:
        from ..studies.map_table import map_columns
        from .common.maps import MapSummary, map_rows

        columns = map_columns(robot, outputs, motion=True, efforts=bool(on.names))
        inverse = partial(map_rows, joints=outputs, efforts=inverse if on.names else None)
        observers.append(MapSummary(robot, outputs))
    remarks = [*branch_line(robot, layout), *effects_line(on), *not_computed(robot, on)]
    observers.append(Summary(robot, "effort", robot.effort_units, columns, remarks=remarks, engine=chosen))
    return Plan(inverse, columns, observers, assemble=chosen.assemble)


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
    from ..streams.reaction_columns import reaction_rows

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
        weights=weights or None,
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
