"""Words of the commands that study a robot: cost, compare, workspace, sweep, identify."""

from functools import partial

import click

from ...studies.cost.points import QUANTITIES, SECONDS
from ..common.figures import plot_option
from ..common.files import (
    complete_robot,
    ends_in,
    existing_file,
    report_file,
    result_file,
    robot_file,
    scene_file,
)
from ..common.options import (
    STRICT,
    Command,
    RobotCommand,
    known_names,
    numbers_by_name,
    parse_grid,
    split_names,
)
from .shared import ENGINE, PYTHON, RULE, far_options, jobs_option, option, run_module


def _robot_or_scene(ctx: click.Context, param: click.Parameter, value: str) -> str:
    """Return the file of a scene or robot; both may be shipped ones, given by name."""
    return (scene_file if value.endswith(".toml") else robot_file)(ctx, param, value)


cost = RobotCommand(
    "cost",
    callback=partial(run_module, "cost"),
    robot=click.Argument(
        ["robot"], callback=_robot_or_scene, metavar="ROBOT|SCENE", shell_complete=complete_robot
    ),
    short_help="Measure what accuracy costs in time, for your robot.",
    help="""Measure what accuracy costs in time: 'cost ROBOT TRAJECTORY' or 'cost SCENE'.

    The command measures error and time of settings, and what each effect is worth. For a robot and a
    trajectory the settings are compiled or general path, float32 or float64, batch or single calls, effects,
    and the source of rates. For a scene they are methods, steps and tolerances. Errors are relative to a
    reference, whose own error is shown. Times are measured on this machine. Ctrl-C prints what was measured.
    """,
    params=[
        click.Argument(["trajectory"], required=False, callback=existing_file, type=click.Path()),
        option(
            "--target", type=click.FloatRange(0, min_open=True),
            help="Print only the fastest setting with this error, as lines for a scene; exit status 1 if "
            "none.",
        ),
        option(
            "--quantity", type=click.Choice([*QUANTITIES]), default="idm", show_default=True,
            help="What is computed along a trajectory.",
        ),
        option(
            "--with", "engines", metavar="NAMES", callback=split_names,
            help="Engines whose settings are swept, too: pinocchio,mujoco or a package's. They compute rigid "
            "bodies alone, and accelerations along a scene.",
        ),
        option("--all", "every", is_flag=True, help="Print every setting, not only those worth having."),
        option(
            "--seconds", type=click.FloatRange(0, min_open=True), default=SECONDS, show_default=True,
            help="Time that the runs of a scene take together [s], besides building C.",
        ),
        option(
            "--until", type=click.FloatRange(0, min_open=True),
            help="Simulate a scene to this time [s] only.",
        ),
        RULE,
        PYTHON,
        option(
            "-o", "--output", metavar="FILE", callback=report_file,
            help="Write all measurements, .csv or .json.",
        ),
        plot_option("error against time", page=True),
    ],
)  # fmt: skip

compare = RobotCommand(
    "compare",
    callback=partial(run_module, "compare"),
    short_help="Compare how other engines simulate a robot and its loops.",
    help="""Compare ROBOT in other engines with hybridyn, at closed states near home.

    Each engine gets the robot twice: read by its own reader from the file, and built from hybridyn's model.
    The table shows the number of degrees of freedom; which closures the engine enforces, softens or ignores;
    and the differences of accelerations and efforts from hybridyn's. Only rigid bodies are compared:
    friction, springs, rotors, limits and contacts are switched off. 'hybridyn cost --with' compares times.

    Exit status: 0 no engine fails --fail-on; 1 an engine does, or the data are wrong; 2 wrong usage.
    """,
    params=[
        option(
            "--with", "engines", metavar="ENGINE,...", default="pinocchio,mujoco", show_default=True,
            callback=known_names("engine", "studies.compare.methods", "engine_names"),
            help="Engines to compare; those that are not installed are listed and skipped.",
        ),
        option(
            "--samples", type=click.IntRange(1, 1000), default=5, show_default=True,
            help="Number of closed states.",
        ),
        option(
            "--seed", type=click.IntRange(0), default=0, show_default=True, help="Seed of the states."
        ),
        option(
            "--tolerance", type=click.FloatRange(0, 1, min_open=True), default=1e-6, show_default=True,
            help="Largest relative difference of an engine that counts as equal.",
        ),
        option("--json", "as_json", is_flag=True, help="Print JSON on standard output."),
        option(
            "--fail-on", type=click.Choice(["ignored", "different", "never"]), default="ignored",
            show_default=True,
            help="Exit with status 1 if an engine ignores a closure, or also if it differs by more than "
            "--tolerance.",
        ),
    ],
)  # fmt: skip

workspace = RobotCommand(
    "workspace",
    callback=partial(run_module, "workspace"),
    short_help="Find the poses that a link reaches, and their efforts.",
    help="""\
    Find the poses that a link of ROBOT reaches from home on its assembly branch, within joint limits.

    With --link, all modules that move this link in the other one move; else one module.

    The poses form a lattice, which is searched from the home pose to neighbours that can be reached. The
    table has a row per reached pose: '<link>@<base>/pose/...', '<motor>/position' of the modules' motors,
    'conditioning' (0 singular, 1 isotropic), 'effort_per_force' and 'effort_per_torque' (the largest effort
    of any motor against 1 N or 1 N m in the worst direction), '<motor>/effort' (against gravity, with the
    other modules at home). Efforts of singular postures are inf.

    With --map, a row has positions of output joints and motors, and '<motor>/per/<joint>', the motor's rate
    per rate of the joint (docs/joint-map.md). Points out of reach or singular are left out and counted.
    """,
    params=[
        plot_option("maps of conditioning and efforts"),
        jobs_option("1"),
        option(
            "-m", "--module", metavar="NUMBER|NAME",
            help="Number (from 1) or name of the only module that moves.  [default: all that move --link, or "
            "the only one with loops]",
        ),
        option(
            "--link", metavar="LINK[@OTHER]",
            help="The link that is moved, and the link in which it is measured, or 'world'.  [default: the "
            "module's platform; in the module's base, or the root]",
        ),
        option(
            "--sweep", metavar="X,Y,...", callback=split_names,
            help="Coordinates of the lattice.  [default: up to three independent ones, else x, y, z]",
        ),
        option(
            "--at", metavar="YAW=0.2,...", multiple=True, callback=numbers_by_name,
            help="Values of the other coordinates, or the lattice's origin [m, rad].  [default: home]",
        ),
        option(
            "--step", "steps", metavar="X=0.01,...", multiple=True, callback=numbers_by_name,
            help="Steps of the lattice [m, rad].  [default: parts of the module's size]",
        ),
        option("--no-limits", is_flag=True, help="Ignore the joints' position limits."),
        RULE,
        option(
            "-o", "--output", metavar="FILE", callback=result_file,
            help="All poses, .csv or .parquet.  [default: stdout]",
        ),
        option(
            "--map", "outputs", metavar="A,B,...", callback=split_names,
            help="Instead of poses: output joints, and the map to their motors.",
        ),
        option(
            "--grid", metavar="GRID", callback=parse_grid,
            help="With --map: points of each joint over its limits, or FROM:TO:COUNT,...",
        ),
    ],
)  # fmt: skip

sweep = Command(
    "sweep",
    callback=partial(run_module, "sweep"),
    short_help="Evaluate many designs of a robot, and find the best.",
    help="""Evaluate the designs of STUDY (a TOML file), and find the best.

    A study names a robot, parameters with their values, tasks, and what is measured; docs/sweeps.md explains
    its keys. The results are written to FOLDER, one file (shard) per second of work; a shard is complete or
    does not exist. The rows are the same, bit for bit, for every number of processes. Designs
    that do not load, do not reach a posture or are singular there have a status and a message. Without STUDY,
    --best and --plot use the results of an earlier run:

    hybridyn sweep -o results --best "peak_effort" --where "reach > 0.2"
    """,
    params=[
        plot_option("every measure over every parameter", page=True),
        jobs_option("one per core"),
        *far_options(""),
        option("--resume", is_flag=True, help="Continue an earlier run."),
        click.Argument(["study"], required=False, metavar="[STUDY]", type=click.Path(dir_okay=False)),
        option("-o", "--output", metavar="FOLDER", default="results", show_default=True, help="The results."),
        option("--allow-python", is_flag=True, help="Allow measures that are functions of Python files."),
        ENGINE,
        option(
            "--gradient", is_flag=True,
            help="Write the derivatives of measures over parameters, too: columns 'MEASURE.d_PARAMETER'.",
        ),
        STRICT,
        option(
            "--best", metavar="A,-B,...",
            help="Print the designs in which A is smallest and B largest; with several, the Pareto front.",
        ),
        option(
            "--where", metavar="CONDITION",
            help="Print only designs that satisfy this condition, such as 'reach > 0.2'.",
        ),
        option(
            "--top", type=click.IntRange(1, 10_000), default=10, show_default=True,
            help="Number of designs to print.",
        ),
    ],
)  # fmt: skip

identify = RobotCommand(
    "identify",
    callback=partial(run_module, "identify"),
    short_help="Identify dynamic parameters from measured motions.",
    help="""\
    Identify dynamic parameters of ROBOT (URDF, MJCF, SDF, USD) from the log MEASURED (CSV or Parquet).

    The log has the columns 'time', and '<motor>/position' and '<motor>/effort' (or '<motor>/current') of
    every motor, in SI units. Tables that PlotJuggler exports are read, too, and uneven times are resampled.
    Passive joints are not measured: the loops are closed.
    """,
    params=[
        plot_option("efforts and spectra of the motors that fit worst"),
        click.Argument(
            ["log"], metavar="[MEASURED]", required=False, callback=existing_file, type=click.Path()
        ),
        option(
            "--effects", metavar="A,B,...", callback=split_names, default="model", show_default=True,
            help="Effects with numbers to identify (docs/effects.md); 'offsets' adds a constant to each "
            "motor.",
        ),
        option("--symmetric", is_flag=True, help="Equal legs share their parameters."),
        option(
            "--method", type=click.Choice(["wls", "irls", "iv"]), default="wls", show_default=True,
            help="Least squares, each motor weighted by its noise; the same robust to outliers; instruments.",
        ),
        option(
            "--reference", metavar="FILE", callback=existing_file,
            help="The commanded motion, for --method iv.",
        ),
        option(
            "--validate", metavar="FILE", callback=existing_file,
            help="Log of a second motion, to test the result.",
        ),
        option("--known", metavar="A,B,...", callback=split_names, help="Parameters known from the file."),
        option(
            "--only", metavar="A,B,...", callback=split_names, help="Parameters to identify.  [default: *]"
        ),
        option(
            "--band", type=click.FloatRange(0, min_open=True), metavar="HZ", help="Band of the positions."
        ),
        option(
            "--period", type=click.FloatRange(0, min_open=True), metavar="S", help="Period of the motion."
        ),
        option(
            "--every", type=click.IntRange(1), metavar="N", help="Samples that are averaged to one."
        ),
        option(
            "-o", "--output", metavar="FILE", callback=ends_in(".urdf", ".xml", ".sdf", ".usda"),
            help="Write the robot with the parameters, as 'hybridyn convert' does.",
        ),
        option("--report", metavar="FILE", callback=ends_in(".md"), help="Write a report in Markdown."),
        option(
            "--excite", metavar="FILE", callback=result_file,
            help="Instead of all this: compute a motion to measure, and write it.",
        ),
        option(
            "--evaluations", type=click.IntRange(1), metavar="N", default=50, show_default=True,
            help="With --excite: candidates that are tried.",
        ),
        ENGINE,
    ],
)  # fmt: skip
