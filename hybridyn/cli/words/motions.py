"""Words of the commands that compute along a motion: idm, ddm, simulate."""

from functools import partial

import click

from ...description.shipped import own_trajectory
from ..common.figures import plot_option
from ..common.files import complete_robot, result_file, scene_file
from ..common.options import STRICT, Command, RobotCommand, numbers_by_name, split_names
from .shared import (
    ENGINE,
    PYTHON,
    QUIET,
    RULE,
    effects_option,
    far_options,
    jobs_option,
    one_or_several,
    option,
    run_module,
)


def _own_table(ctx: click.Context, param: click.Parameter, value: str | None) -> str:
    """Return the table that the user names, or the trajectory that comes with a shipped robot."""
    table = value or own_trajectory(ctx.params.get("robot") or "")
    if table is None:
        raise click.MissingParameter(ctx=ctx, param=param, param_hint="'TRAJECTORY'")
    return one_or_several(ctx, param, table)


def _table_options(plot: str) -> list[click.Parameter]:
    """Return the options of a command from table to table. `plot`: the content of a figure, for the help."""
    return [
        option(
            "-o", "--output", metavar="FILE",
            help="Result; a folder for several tables.  [default: stdout]",
        ),
        option(
            "--reactions", metavar="FILE", callback=result_file,
            help="Write internal wrenches, too, .csv or .parquet.",
        ),
        plot_option(plot, page=True),
        RULE,
        QUIET,
        jobs_option("1; one per core for long tables"),
        option("--resume", is_flag=True, help="Several tables: Continue an earlier run."),
        *far_options("Several tables: "),
    ]  # fmt: skip


idm = RobotCommand(
    "idm",
    callback=partial(run_module, "idm"),
    short_help="Compute motor efforts for a motion (inverse dynamic model), and size motors.",
    help="""\
    Compute the motor efforts that move ROBOT (URDF, MJCF, SDF, USD) along TRAJECTORY (CSV or Parquet).

    ROBOT may be the name of a shipped robot ('hybridyn --robots'), which has a trajectory of its own.

    The table has named columns, in SI units, such as 'time', '<joint>/position', '<link>/pose/x' or
    '<link>/wrench/fx' (docs/tables.md): the motion of motors, of any links, of both, or of every joint.
    Missing rates are fitted by a spline. The result has a row per sample, and '<motor>/effort'. With
    --loads, --bearings and --by-effect it is a report on the motors, the joints or the effects.
    """,
    params=[
        click.Argument(
            ["source"], metavar="[TRAJECTORY]", required=False, callback=_own_table, type=click.Path()
        ),
        option("--loads", is_flag=True, help="Tell what the motion requires of each motor."),
        option("--bearings", is_flag=True, help="Tell the radial, axial and tilting loads of each joint."),
        option("--by-effect", is_flag=True, help="Tell what each effect adds to the efforts."),
        option(
            "--map", "outputs", metavar="A,B,...", callback=split_names,
            help="Output joints: add their motion, efforts and map.",
        ),
        effects_option(None),
        option(
            "--passive", type=click.Choice(["given", "solved"]), default="given", show_default=True,
            help="Accelerations of joints without a motor.",
        ),
        option(
            "--on-singular", type=click.Choice(["raise", "least-norm"]), metavar="raise|least-norm",
            default="raise", show_default=True, help="What to do at a singular posture.",
        ),
        option(
            "--weights", metavar="MOTOR=X,...", multiple=True, callback=numbers_by_name,
            help="Weights of redundant motors.",
        ),
        option(
            "--fail-on", type=click.Choice(["limit", "never"]),
            help="Exit with status 1 beyond a limit, or never.  [default: limit with --loads, else never]",
        ),
        ENGINE,
        *_table_options("the result"),
    ],
)  # fmt: skip

ddm = RobotCommand(
    "ddm",
    callback=partial(run_module, "ddm"),
    short_help="Compute accelerations from efforts (direct dynamic model).",
    help="""Compute the accelerations of ROBOT (URDF, MJCF, SDF, USD) for the states and efforts in STATES.

    The table has named columns, in SI units (docs/tables.md): '<motor>/effort' for every motor; 'time';
    positions and velocities of every joint, or of the motors or links, from which the state is assembled;
    wrenches on links. With '--base moving' the table also has the base's acceleration,
    '<root link>/acceleration/x|y|z|wx|wy|wz'; other accelerations are not read. Missing velocities are fitted
    by a spline.

    The result has a row per sample, with '<joint>/acceleration' for every joint, and
    '<root link>/acceleration/x' .. 'wz' for a floating base.
    """,
    params=[
        click.Argument(["source"], metavar="STATES", callback=one_or_several, type=click.Path()),
        effects_option("default"),
        ENGINE,
        *_table_options("the motors' accelerations, grouped by module"),
    ],
)

simulate = Command(
    "simulate",
    callback=partial(run_module, "simulate"),
    short_help="Simulate a scene: a robot under a controller and effects.",
    help="""Simulate SCENE, a TOML file that names robot, start, controller, effects, solver and outputs.

    The result has one row per output time: 'time'; '<joint>/position|velocity|acceleration' of every joint;
    '<motor>/effort'; 'energy/kinetic|potential|total'; 'residual' of the closures. 'hybridyn idm' reads it
    back as a trajectory. Robot, method, effects that were on, and engine are said on standard error.

    Ctrl-C stops after the current step. The rows so far are written to FILE, and the state to FILE.state.
    --resume continues the run; the result is the same, bit for bit, as that of a run without a stop.
    FILE.state is also written every 1,000 steps, and removed at the end, also where an error ends the run.
    While it exists, a new run into FILE needs --overwrite.
    """,
    params=[
        plot_option("the motion of the motors, efforts, power, energy and residuals", page=True),
        click.Argument(["scene"], callback=scene_file, shell_complete=complete_robot),
        option(
            "-o", "--output", metavar="FILE", callback=result_file,
            help="Result file, .csv or .parquet  [default: the scene's, else CSV on standard output]",
        ),
        option(
            "--until", type=click.FloatRange(0, min_open=True),
            help="Stop after the step that reaches this time [s].",
        ),
        option("--resume", is_flag=True, help="Continue the run in FILE, which was stopped."),
        option("--overwrite", is_flag=True, help="Begin anew where FILE holds a run that was stopped."),
        PYTHON,
        ENGINE,
        QUIET,
        STRICT,
    ],
)  # fmt: skip
