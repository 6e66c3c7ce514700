"""`hybridyn view`: show a robot in 3-D, on a page in the browser or in a file."""

from __future__ import annotations

import importlib.util
import threading
from collections.abc import Iterator
from typing import TYPE_CHECKING

import click

from ..errors import install_advice
from .common.files import ends_in, existing_file
from .common.options import RobotChoice, RobotCommand, takes_effects
from .common.progress import Progress

if TYPE_CHECKING:
    from ..description.records import Array
    from ..streams.postures import Postures
    from ..structure.robot import HybridRobot
    from ..view.film import Shot
    from ..view.picture import Picture
    from ..view.render import Image
    from ..view.run import Run

SHAPES = ("yourdfpy", "trimesh")
PICTURES = ("PIL", "embreex", *SHAPES)
NEEDS = {"page": ("viser", *SHAPES), ".png": PICTURES, ".mp4": ("imageio_ffmpeg", *PICTURES)}
SMALLEST, LARGEST = 64, 4096  # pixels


def _size(ctx: click.Context, param: click.Parameter, value: str) -> tuple[int, int]:
    """Parse "1280x720"; films need even numbers."""
    parts = value.lower().split("x")
    if len(parts) != 2 or not all(part.isdecimal() for part in parts):
        raise click.BadParameter(f"'{value}' is not of the form 1280x720", ctx, param)
    width, height = (int(part) for part in parts)
    if not all(SMALLEST <= number <= LARGEST and number % 2 == 0 for number in (width, height)):
        message = f"'{value}': width and height must be even, from {SMALLEST} to {LARGEST}"
        raise click.BadParameter(message, ctx, param)
    return width, height


@click.command(
    "view", cls=RobotCommand, short_help="Show a robot in 3-D: drag motors, play motions; PNG, MP4."
)
@click.argument("motion", required=False, callback=existing_file)
@click.option(
    "--plot",
    metavar="FILE",
    callback=ends_in(".png", ".mp4"),
    help="Write a picture, .png, or a film, .mp4, instead; without a motion, the camera of the film moves "
    "around the robot.",
)
@click.option("--time", "at", type=float, metavar="T", help="Time of the picture [s].  [default: the first]")
@click.option(
    "--size", default="960x720", show_default=True, callback=_size, help="Pixels of picture or film."
)
@click.option(
    "--colours",
    type=click.Choice(["modules", "file"]),
    default="modules",
    show_default=True,
    help="Colours of picture and film: one per module, or those of the robot's file.",
)
@takes_effects("default")
@click.option(
    "--host",
    default="127.0.0.1",
    show_default=True,
    help="Address at which the page listens; with 0.0.0.0, other machines can see it.",
)
@click.option(
    "--port", type=click.IntRange(0, 65535), default=8080, show_default=True, help="Port of the page."
)
@click.option("--no-browser", is_flag=True, help="Do not open the browser; the address is printed.")
def command(
    load: RobotChoice,
    motion: str | None,
    plot: str | None,
    at: float | None,
    size: tuple[int, int],
    colours: str,
    effects: tuple[str, ...],
    host: str,
    port: int,
    no_browser: bool,
) -> None:
    """Show ROBOT in 3-D, on a page in the browser: modules in colours, closures yellow, motors as sliders.

    Loops stay closed while you drag a motor. If they cannot be closed any further, the motor stops, and the
    page says why. MOTION is a trajectory or the result of a simulation, which you can play on the page. Bars
    show the efforts in MOTION, or else those that 'hybridyn idm' computes. Ctrl-C ends the command.

    --plot needs neither browser nor screen. Links are drawn with their URDF visuals, or as rods and plates
    between their joints if a mesh file is missing.
    """
    _check_installed(plot[-4:].lower() if plot else "page")
    robot = load()
    picture = _picture(robot, load)
    run = None if motion is None else _run(robot, motion, effects)
    if plot:
        from ..view.film import Shot

        _write(Shot(robot, picture, size, colours == "file"), run, at, plot)
        return
    _serve(robot, picture, run, host, port, browser=not no_browser)


def _check_installed(what: str) -> None:
    """Check, before any work is done, that the needed packages are installed."""
    for package in NEEDS[what]:
        if importlib.util.find_spec(package) is None:
            raise click.UsageError(f"this needs {package}: {install_advice('view')}")


def _picture(robot: HybridRobot, choice: RobotChoice) -> Picture:
    """Build the picture of the robot from the visuals of its file."""
    from ..view.drawing import draw
    from ..view.visuals import read_visuals

    visuals, notes = read_visuals(choice.robot, choice.xacro_args, choice.package_dirs)
    for note in notes:
        click.echo(f"note: {note}; links without any are drawn in primitive shapes", err=True)
    return draw(robot, visuals, notes)


def _run(robot: HybridRobot, file: str, effects: tuple[str, ...]) -> Run:
    """Read a motion, and read or compute the efforts along it."""
    import numpy as np

    from ..streams.one_pass import read_postures
    from ..view.run import MOST, Run

    found = read_postures(robot, file)[1]
    tau, origin = _efforts(robot, file, found, effects)
    step, time = -(-len(found.q) // MOST), found.motion.time
    shown = np.arange(1.0, len(found.q) + 1) if time is None else time
    return Run(shown[::step], found.q[::step], None if tau is None else tau[::step], origin, time is not None)


def _efforts(
    robot: HybridRobot, file: str, found: Postures, effects: tuple[str, ...]
) -> tuple[Array | None, str]:
    """Return the efforts along a motion: the table's where it has all of them, else the inverse model's.

    Returns:
        Efforts, shape (T, motors), [N or N m], or None; and their origin, or the reason why there are none.
    """
    import numpy as np

    from ..effects import choose
    from ..errors import HybridynError
    from ..streams.one_pass import efforts_in_blocks
    from ..tables.opening import open_table

    wanted = [f"{motor}/effort" for motor in robot.motors]
    if not wanted:
        return None, "there are no motors"
    with open_table(file) as table:
        if set(wanted) <= set(table.columns):
            at = [table.columns.index(name) for name in wanted]
            return np.concatenate([block.values[:, at] for block in table.blocks]), "of the table"
    motion, q, v, a = found
    try:
        on = choose(robot, effects)
        tau = efforts_in_blocks(robot, q, v, a, on, wrenches=motion.wrenches, time=motion.time)
    except HybridynError as error:
        return None, f"cannot be had: {str(error).partition('. ')[0]}"
    return tau, "of the inverse model"


def _write(shot: Shot, run: Run | None, at: float | None, target: str) -> None:
    """Write a picture or a film, as the ending of the file says."""
    from ..description.writing import appearing
    from ..view.film import frames_around, frames_of_run, pictures_of, save_mp4, still
    from ..view.render import save_png

    if at is not None and run is None:
        raise click.UsageError("--time says a time of a motion, and there is no motion")
    if run is not None and at is not None and not run.begin <= at <= run.end:
        raise click.UsageError(f"--time {at:g}: the motion goes from {run.begin:g} to {run.end:g}")
    with appearing(target) as draft, Progress("pictures") as progress:
        if target.lower().endswith(".png"):
            save_png(still(shot, run, at), str(draft))
            return
        frames = frames_around(shot, shot.robot.home) if run is None else frames_of_run(shot, run)
        whole, _ = pictures_of(run)

        def told() -> Iterator[Image]:
            """Yield the frames, and show the progress after each."""
            for count, frame in enumerate(frames):
                progress.show(count + 1, (count + 1) / whole)
                yield frame

        save_mp4(told(), shot.size, str(draft))


def _serve(
    robot: HybridRobot, picture: Picture, run: Run | None, host: str, port: int, *, browser: bool
) -> None:
    """Serve the page until Ctrl-C."""
    import webbrowser

    from ..view.page import Page

    page = Page(robot, picture, run, host=host, port=port)
    try:
        click.echo(f"{robot.name}: {page.url} (Ctrl-C ends it)")
        if browser:
            webbrowser.open(page.url)
        threading.Event().wait()
    except KeyboardInterrupt:
        click.echo("", err=True)
    finally:
        page.close()
