"""The words of all commands: arguments, options and help. What a command does is in its module."""

from functools import partial
from importlib import import_module
from typing import Any

import click

from ..description.shipped import own_trajectory
from ..studies.cost.points import QUANTITIES, SECONDS
from .common.figures import chart_file, plot_option
from .common.files import (
    complete_robot,
    ends_in,
    existing_file,
    report_file,
    result_file,
    robot_file,
    scene_file,
    several,
)
from .common.options import (
    PACKAGES,
    STRICT,
    XACRO,
    Command,
    RobotCommand,
    known_names,
    numbers_by_name,
    parse_grid,
    split_names,
)

#: Number of findings of one code that `info` prints; the rest are counted.
PRINTED = 12
SMALLEST, LARGEST = 64, 4096  # of a picture [pixels]


def option(*names: str, **words: Any) -> click.Option:
    """Return an option, from the arguments of `click.option`."""
    return click.Option(names, **words)


def _run(name: str, /, **words: Any) -> Any:
    """Import the module of a command, and run it with the values of arguments and options."""
    return import_module(f"hybridyn.cli.{name}").run(**words)


def _effects_option(default: str | None) -> click.Option:
    """Return `--effects`. `default`: what applies where the user gives none, None where there are several."""
    more = "" if default else ".  [default: default; with --loads and --by-effect model]"
    return option(
        "--effects", metavar="A,B,...", default=default, show_default=bool(default),
        callback=known_names("effect", "effects.choice", "UNITS", "WORDS"),
        help="Effects: 'default' (gravity, inertia, leg_inertia, velocity), 'model' (all that the files "
        f"state), 'none', or names (docs/effects.md){more}",
    )  # fmt: skip


def _jobs_option(default: str) -> click.Option:
    """Return `--jobs`. `default`: the number of processes where the user gives none."""
    return option(
        "-j", "--jobs", type=click.IntRange(1), metavar="N", help=f"Processes.  [default: {default}]"
    )


def _own_table(ctx: click.Context, param: click.Parameter, value: str | None) -> str:
    """Return the table that the user names, or the trajectory that comes with a shipped robot."""
    table = value or own_trajectory(ctx.params.get("robot") or "")
    if table is None:
        raise click.MissingParameter(ctx=ctx, param=param, param_hint="'TRAJECTORY'")
    return _tables(ctx, param, table)


def _tables(ctx: click.Context, param: click.Parameter, value: str) -> str:
    """Check a table, or let a folder or a glob of several pass."""
    return value if several(value) else existing_file(ctx, param, value)


def _robot_or_scene(ctx: click.Context, param: click.Parameter, value: str) -> str:
    """Return the file of a scene or robot; both may be shipped ones, given by name."""
    return (scene_file if value.endswith(".toml") else robot_file)(ctx, param, value)


def _size(ctx: click.Context, param: click.Parameter, value: str) -> tuple[int, ...]:
    """Parse "1280x720"; films need even numbers."""
    size = tuple(int(part) if part.isdecimal() else 0 for part in value.split("x"))
    if len(size) != 2 or not all(SMALLEST <= part <= LARGEST and part % 2 == 0 for part in size):
        message = f"'{value}' is not two even numbers from {SMALLEST} to {LARGEST}, as 1280x720"
        raise click.BadParameter(message, ctx, param)
    return size


ENGINE = option(
    "--engine", type=click.Choice(["general", "compiled"]),
    help="Models in Python or in C.  [default: C where it pays]",
)  # fmt: skip
PYTHON = option("--allow-python", is_flag=True, help="Let the scene run the Python controller that it names.")
QUIET = option("-q", "--quiet", is_flag=True, help="No summary.")


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
        QUIET,
        _jobs_option("1; one per core for long tables"),
        option("--resume", is_flag=True, help="Several tables: Continue an earlier run."),
    ]  # fmt: skip


idm = RobotCommand(
    "idm",
    callback=partial(_run, "idm"),
    short_help="Compute motor efforts for a motion (inverse dynamic model), and size motors.",
    help="""\
    Compute the motor efforts that move ROBOT (URDF, MJCF, SDF, USD) along TRAJECTORY (CSV or Parquet).

    ROBOT may be the name of a shipped robot ('hybridyn --robots'), which has a trajectory of its own.

    The table has named columns, in SI units, such as 'time', '<joint>/position', '<link>/pose/x' or
    '<link>/wrench/fx' (docs/tables.md): the motion of motors, of any links, of both, or of every joint.
    Missing rates are fitted by a spline. The result has a row per sample, and '<motor>/effort'. With --loads
    it is peak and RMS effort, speed, power and energy of each motor; with --by-effect, what each effect adds.
    """,
    params=[
        click.Argument(
            ["source"], metavar="[TRAJECTORY]", required=False, callback=_own_table, type=click.Path()
        ),
        option("--loads", is_flag=True, help="Tell what the motion requires of each motor."),
        option("--by-effect", is_flag=True, help="Tell what each effect adds to the efforts."),
        option(
            "--map", "outputs", metavar="A,B,...", callback=split_names,
            help="Output joints: add their motion, efforts and map.",
        ),
        _effects_option(None),
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
    callback=partial(_run, "ddm"),
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
        click.Argument(["source"], metavar="STATES", callback=_tables, type=click.Path()),
        _effects_option("default"),
        ENGINE,
        *_table_options("the motors' accelerations, grouped by module"),
    ],
)

simulate = Command(
    "simulate",
    callback=partial(_run, "simulate"),
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

cost = RobotCommand(
    "cost",
    callback=partial(_run, "cost"),
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
            help="Engines whose settings are swept, too: pinocchio,mujoco. They compute rigid bodies alone, "
            "and accelerations along a scene.",
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
        PYTHON,
        option(
            "-o", "--output", metavar="FILE", callback=report_file,
            help="Write all measurements, .csv or .json.",
        ),
        plot_option("error against time", page=True),
    ],
)  # fmt: skip

convert = RobotCommand(
    "convert",
    callback=partial(_run, "convert"),
    short_help="Write a robot as MJCF, SDF, URDF or USD, or its models as C.",
    help="""Write ROBOT (URDF, MJCF, SDF, USD) in another format, or its models as C.

    Tree, closures, inertias, limits, motors, effects and home are written as far as the format can express
    them. Each line 'lost: ...' names a property that it cannot express; with --strict, the exit status is
    then 1. A file FILE.model.toml beside the output contains data that only hybridyn reads.

    With --c, the folder gets a header, a source, a test with reference values, a Makefile and a README, with
    one function per model. The code allocates no memory, and needs only <math.h>.
    """,
    params=[
        option(
            "-o", "--output", metavar="FILE", required=True,
            help="The file; its ending names the format: .urdf, .xml (MJCF), .sdf, .usda. With --c, a "
            "folder.",
        ),
        option(
            "--tightness", type=click.FloatRange(0, min_open=True), metavar="NUMBER", default=1e-4,
            show_default=True,
            help="Distance by which closures may open in a simulator that holds them with springs [m].",
        ),
        option("--c", "as_c", is_flag=True, help="Write the dynamic models as C99."),
        option("--name", metavar="NAME", help="With --c: prefix of files and names.  [default: the robot's]"),
        option("--float32", is_flag=True, help="With --c: single precision."),
        option(
            "--map", "map_joints", metavar="A,B,...", callback=split_names,
            help="With --c: output joints, whose map to the motors that move them is written, too.",
        ),
        option(
            "--parameters", metavar="A,B,...", callback=split_names,
            help="With --c: numbers that are arguments of the functions: mass:LINK, position:JOINT, "
            "arguments of a xacro file.",
        ),
        option(
            "--wrenches", metavar="A,B,...", callback=split_names,
            help="With --c: links on which wrenches are arguments, such as the feet of a robot that stands.",
        ),
        _effects_option("default"),
    ],
)  # fmt: skip

plot = Command(
    "plot",
    callback=partial(_run, "plot"),
    short_help="Draw what a command wrote: motions, efforts, loads, workspaces, sweeps.",
    help="""Draw TABLE, a file that a command wrote, or the folder of a sweep.

    A trajectory or a result of idm, ddm or simulate is drawn over time, with energies and the closure
    residual. If it contains efforts, only joints with an effort (motors) are drawn. With --robot, as with the
    option '--plot' of these commands, each module has a panel per quantity, with limits; without it, each
    joint has an axis of its own, since the table does not state which joints slide and which turn.

    Loads of motors and effects ('idm --loads', '--by-effect') are bars, a workspace is maps, a sweep shows
    every measure over every parameter.
    """,
    params=[
        XACRO,
        PACKAGES,
        STRICT,
        click.Argument(["table"], callback=_tables),
        option(
            "-o", "--output", metavar="FILE", required=True, callback=chart_file,
            help="File of the figure, .png, .svg or .pdf, or .html for a page to zoom into",
        ),
        option(
            "--robot", metavar="ROBOT", shell_complete=complete_robot,
            callback=lambda ctx, param, value: value and robot_file(ctx, param, value),
            help="The table's robot, a file or a shipped robot: joints of a module with the same unit share "
            "an axis.",
        ),
    ],
)  # fmt: skip

view = RobotCommand(
    "view",
    callback=partial(_run, "view"),
    short_help="Show a robot in 3-D: drag motors, play motions; PNG, MP4.",
    help="""\
    Show ROBOT in 3-D, on a page in the browser: modules in colours, closures yellow, motors as sliders.

    Loops stay closed while you drag a motor. If they cannot be closed any further, the motor stops, and the
    page says why. MOTION is a trajectory or the result of a simulation, which you can play on the page. Bars
    show the efforts in MOTION, or else those that 'hybridyn idm' computes. Ctrl-C ends the command.

    --plot needs neither browser nor screen. Links are drawn with their URDF visuals, or as rods and plates
    between their joints if a mesh file is missing.
    """,
    params=[
        click.Argument(["motion"], required=False, callback=existing_file),
        option(
            "--plot", metavar="FILE", callback=ends_in(".png", ".mp4"),
            help="Write a picture, .png, or a film, .mp4, instead; without a motion, the camera of the film "
            "moves around the robot.",
        ),
        option(
            "--time", "at", type=float, metavar="T", help="Time of the picture [s].  [default: the first]"
        ),
        option(
            "--size", default="960x720", show_default=True, callback=_size, help="Pixels of picture or film."
        ),
        option(
            "--colours", type=click.Choice(["modules", "file"]), default="modules", show_default=True,
            help="Colours of picture and film: one per module, or those of the robot's file.",
        ),
        _effects_option("default"),
        option(
            "--host", default="127.0.0.1", show_default=True,
            help="Address at which the page listens; with 0.0.0.0, other machines can see it.",
        ),
        option(
            "--port", type=click.IntRange(0, 65535), default=8080, show_default=True, help="Port of the page."
        ),
        option("--no-browser", is_flag=True, help="Do not open the browser; the address is printed."),
    ],
)  # fmt: skip

info = RobotCommand(
    "info",
    callback=partial(_run, "info"),
    short_help="Show modules, closures, motors, and mistakes and how to mend them.",
    help="""Show ROBOT (URDF, MJCF, SDF, USD) as the tree of its modules, and what looks wrong in its files.

    For each module: its mobility and motors, platforms, legs with their joints (motors marked *), closures by
    type, redundancy, motions without a motor or without inertia, and whether its loops close at the home
    posture. Equal modules are described once.

    Findings follow: each has a code, a severity, the element with its line, why it matters and how to correct
    it. An error means that results are wrong or cannot be computed; a warning that they probably are; a note
    informs. docs/check.md lists all codes.
    """,
    params=[
        plot_option("the tree of modules"),
        option(
            "--fail-on", type=click.Choice(["error", "warning", "note", "never"]), default="never",
            show_default=True, help="Exit with status 1 if there is a finding of this severity or above.",
        ),
        option(
            "--ignore", metavar="CODE,...", callback=known_names("finding", "studies.check.finding", "CODES"),
            help="Codes of findings to leave out.",
        ),
        option("--all", "everything", is_flag=True, help=f"Print more than {PRINTED} findings of one code."),
        option("--no-meshes", is_flag=True, help="Do not search or load mesh files."),
        option("--json", "as_json", is_flag=True, help="Print the findings alone, as JSON."),
    ],
)  # fmt: skip

home = RobotCommand(
    "home",
    callback=partial(_run, "home"),
    short_help="Find closed home postures; write one to model.toml.",
    help="""Find postures of ROBOT (URDF, MJCF, SDF, USD) that close its loops with its motors at home.

    The search starts from random postures, so --all may still miss a posture. The command prints the chosen
    posture as the table [home] of model.toml. --write writes it to that file, and changes nothing else there.
    """,
    params=[
        option(
            "--at", metavar="NAME=NUMBER", multiple=True, callback=numbers_by_name,
            help="Position of a motor, or of another joint in place of one [m or rad]; other motors stay at "
            "home, and so does what neither they nor the loops determine. May be repeated.",
        ),
        option("--all", "everything", is_flag=True, help="List all postures that are found."),
        option(
            "--starts", type=click.IntRange(1), default=200, show_default=True,
            help="Random starts per module.",
        ),
        option(
            "--seed", type=click.IntRange(0), default=0, show_default=True, help="Seed of the starts."
        ),
        option(
            "--choose", type=click.IntRange(1), metavar="NUMBER",
            help="The posture that is shown or written, as --all numbers them.  [default: the nearest to "
            "home within limits]",
        ),
        option("--write", is_flag=True, help="Write the posture to the robot's model.toml."),
    ],
)  # fmt: skip

compare = RobotCommand(
    "compare",
    callback=partial(_run, "compare"),
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
            callback=known_names("engine", "studies.compare.methods", "ENGINES"),
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
    callback=partial(_run, "workspace"),
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
        _jobs_option("1"),
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
    callback=partial(_run, "sweep"),
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
        _jobs_option("one per core"),
        option("--resume", is_flag=True, help="Continue an earlier run."),
        click.Argument(["study"], required=False, metavar="[STUDY]", type=click.Path(dir_okay=False)),
        option("-o", "--output", metavar="FOLDER", default="results", show_default=True, help="The results."),
        option("--allow-python", is_flag=True, help="Allow measures that are functions of Python files."),
        ENGINE,
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
    callback=partial(_run, "identify"),
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
