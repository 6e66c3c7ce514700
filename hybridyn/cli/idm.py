"""`hybridyn idm`: motor efforts for a motion."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import click

from ..streams.reaction_columns import reaction_rows
from .common.engine import choose_engine, takes_engine
from .common.options import RobotCommand, takes_effects, takes_robot
from .common.summary import Summary, effects_line, not_computed
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
    help="Accelerations of joints without a motor: as the table says, or those of zero effort.",
)


@click.command("idm", cls=RobotCommand, short_help="Motor efforts for a motion (inverse dynamic model).")
@takes_robot
@takes_table("TRAJECTORY", own=True, plot="the efforts, motors grouped by module")
@takes_passive
@click.option(
    "--on-singular",
    type=click.Choice(["raise", "least-norm"]),
    default="raise",
    show_default=True,
    help="At a singular posture: stop, or take the smallest efforts.",
)
@click.option(
    "--weights",
    multiple=True,
    help="How redundant motors share: motor=value for every motor (commas or repeated), or a CSV file with "
    "the motors' names and one row.",
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
    """Return the motor efforts that move ROBOT (URDF or xacro) as TRAJECTORY (CSV or Parquet) says.

    ROBOT may be the name of a shipped robot ('hybridyn robots'), which has a trajectory of its own.

    The table has named columns, in SI units: 'time', '<joint>/position|velocity|acceleration',
    '<link>/pose/x|y|z|qx|qy|qz|qw' or any of 'x|y|z|roll|pitch|yaw' relative to the root link
    ('<link>@<other>/...': to another link), '<link>/velocity|acceleration/x|y|z|wx|wy|wz',
    '<link>/wrench/fx|fy|fz|mx|my|mz'. It names the motors, the platforms, a mixture, or every joint;
    missing rates are fitted by a spline over time.

    One row per sample comes out, with 'time' and a column '<motor>/effort' per motor.
    """

    def plan(robot: HybridRobot, layout: Layout, rows: int | None) -> Plan:
        from ..effects import choose

        shares, chosen = read_weights(weights, robot.motors), choose(robot, effects)
        refuse_massless(robot, chosen, layout)
        obstacles = {
            "--reactions": tables.reactions is not None,
            "--passive solved": passive != "given",
            "--on-singular least-norm": on_singular != "raise",
            "--weights": shares is not None,
            "wrenches in the table": bool(layout.wrenches),
        }
        chosen_engine = choose_engine(engine, robot, chosen, rows, obstacles)
        model = functools.partial(
            efforts,
            passive=passive,
            on_singular=on_singular,
            weights=shares,
            effects=chosen,
            reactions=tables.reactions is not None,
            compiled=chosen_engine.model,
        )
        kinds = {joint.name: joint.kind for joint in robot.description.joints}
        units = ["N" if kinds[name] == "prismatic" else "N m" for name in robot.motors]
        summary = Summary(
            robot,
            "effort",
            list(robot.motors),
            units,
            list(range(len(robot.motors))),
            remarks=[*effects_line(chosen), *not_computed(robot, chosen)],
            engine=chosen_engine,
        )
        return Plan(model, [f"{name}/effort" for name in robot.motors], summary)

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
    """Return the efforts of a block, shape (T, motors), and the reactions' rows where they are wanted.

    Args:
        robot: The robot.
        block: The motion.
        effects: As `hybridyn.idm` takes them, as all that follow.
        passive: Whether the passive joints' accelerations count.
        on_singular: What to do at singular postures.
        weights: How redundant motors share.
        reactions: Whether reactions are wanted.
        compiled: The robot's compiled models, where they do it.
    """
    import hybridyn

    from ..streams.blocks import Rows
    from ..structure.departures import departures

    if compiled is not None:
        before = compiled.recomputed
        tau = compiled.idm(block.q, block.v, block.a)
        left = departures(robot, block.q, block.v, tau)
        return Rows(tau, handed_over=compiled.recomputed - before, left=left)
    model = functools.partial(
        hybridyn.idm,
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
    )
    tau, inner = model(reactions=True) if reactions else (model(), None)
    left = departures(robot, block.q, block.v, tau)
    return Rows(tau, None if inner is None else reaction_rows(robot, inner), left=left)


def refuse_massless(robot: HybridRobot, effects: Effects, layout: Layout) -> None:
    """Refuse a robot of which nothing has mass, where every effort would be zero.

    Args:
        robot: The robot.
        effects: What is computed.
        layout: The meaning of the table's columns.

    Raises:
        ModelError: No link has mass, and neither effects nor the table's wrenches make an effort.
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

    Args:
        words: Values of `--weights`.
        motors: Names of the motors.

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
