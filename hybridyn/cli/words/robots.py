"""Words of the commands that show, change or write a robot: convert, plot, view, info, home."""

from functools import partial

import click

from ..common.figures import chart_file, plot_option
from ..common.files import complete_robot, ends_in, existing_file, robot_file
from ..common.options import (
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
from .shared import RULE, effects_option, one_or_several, option, run_module

#: Number of findings of one code that `info` prints; the rest are counted.
PRINTED = 12
SMALLEST, LARGEST = 64, 4096  # of a picture [pixels]


def _size(ctx: click.Context, param: click.Parameter, value: str) -> tuple[int, ...]:
    """Parse "1280x720"; films need even numbers."""
    size = tuple(int(part) if part.isdecimal() else 0 for part in value.split("x"))
    if len(size) != 2 or not all(SMALLEST <= part <= LARGEST and part % 2 == 0 for part in size):
        message = f"'{value}' is not two even numbers from {SMALLEST} to {LARGEST}, as 1280x720"
        raise click.BadParameter(message, ctx, param)
    return size


convert = RobotCommand(
    "convert",
    callback=partial(run_module, "convert"),
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
            help="The file; its ending names the format: .urdf, .xml (MJCF), .sdf, .usda. With --c and "
            "--ros, a folder.",
        ),
        option(
            "--tightness", type=click.FloatRange(0, min_open=True), metavar="NUMBER", default=1e-4,
            show_default=True,
            help="Distance by which closures may open in a simulator that holds them with springs [m].",
        ),
        option("--c", "as_c", is_flag=True, help="Write the dynamic models as C99."),
        option(
            "--ros", "as_ros", is_flag=True,
            help="Write a folder for RViz: the tree with loops cut, a launch file, parameters of 'hybridyn "
            "ros'.",
        ),
        option("--name", metavar="NAME", help="With --c: prefix of files and names.  [default: the robot's]"),
        option("--float32", is_flag=True, help="With --c: single precision."),
        option(
            "--map", "map_joints", metavar="A,B,...", callback=split_names,
            help="With --c: output joints, whose map to the motors that move them is written, too. With "
            "--ros: output joints of trajectories.",
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
        option(
            "--given", metavar="A,B,...", callback=split_names,
            help="With --c: columns as in tables, from which a control step takes its motion: LINK/pose, "
            "LINK/pose/x, JOINT/position.",
        ),
        option(
            "--acados", is_flag=True,
            help="With --c: the direct model over the motors, with two orders of derivatives, is written, "
            "too, as functions that acados calls.",
        ),
        option("--redundancy", hidden=True),  # those who know it from other commands are told what to do
        effects_option("default"),
    ],
)  # fmt: skip

plot = Command(
    "plot",
    callback=partial(run_module, "plot"),
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
        click.Argument(["table"], callback=one_or_several),
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
    callback=partial(run_module, "view"),
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
        effects_option("default"),
        option(
            "--host", default="127.0.0.1", show_default=True,
            help="Address at which the page listens; with 0.0.0.0, other machines can see it.",
        ),
        option(
            "--port", type=click.IntRange(0, 65535), default=8080, show_default=True, help="Port of the page."
        ),
        RULE,
        option("--no-browser", is_flag=True, help="Do not open the browser; the address is printed."),
    ],
)  # fmt: skip

info = RobotCommand(
    "info",
    callback=partial(run_module, "info"),
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
        option(
            "--joints", metavar="A,B,...", callback=split_names,
            help="With --actuators: output joints, such as pitch and roll of a parallel ankle.",
        ),
        option(
            "--actuators", metavar="FILE",
            help="Write the motors as simulators of serial joints need them: armature, damping, gains and "
            "limits of effort at the output joints, over their range; and print one number of each, with its "
            "error.",
        ),
        option(
            "--grid", metavar="GRID", callback=parse_grid,
            help="With --actuators: points per joint, or FROM:TO:COUNT,...  [default: 9, between the limits]",
        ),
    ],
)  # fmt: skip

home = RobotCommand(
    "home",
    callback=partial(run_module, "home"),
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
