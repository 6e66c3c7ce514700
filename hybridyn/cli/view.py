"""`hybridyn view`: show a robot in 3-D, on a page in the browser or in a file."""

import threading
import webbrowser
from collections.abc import Iterator

import click
import numpy as np

from ..assembly.redundancy import check_rule
from ..description.writing import appearing
from ..effects import choose
from ..errors import HybridynError, required
from ..spatial import Array
from ..streams.one_pass import efforts_in_blocks, read_postures
from ..streams.postures import TreeSamples
from ..structure.robot import HybridRobot
from ..tables.opening import open_table
from ..view.drawing import draw
from ..view.film import Shot, frames_around, frames_of_run, pictures_of, save_mp4, still
from ..view.picture import Picture
from ..view.render import Image, save_png
from ..view.run import MOST, ShownMotion
from ..view.visuals import read_visuals
from .common.options import RobotChoice, refuse
from .common.progress import progress

SHAPES = ("yourdfpy", "trimesh")
PICTURES = ("PIL", "embreex", *SHAPES)
NEEDS = {"page": ("viser", *SHAPES), ".png": PICTURES, ".mp4": ("imageio_ffmpeg", *PICTURES)}


def run(
    load: RobotChoice,
    motion: str | None,
    plot: str | None,
    at: float | None,
    size: tuple[int, int],
    colours: str,
    effects: tuple[str, ...],
    redundancy: str,
    host: str,
    port: int,
    no_browser: bool,
) -> None:
    """Show a robot on a page, or write a picture or a film."""
    for package in NEEDS[plot[-4:].lower() if plot else "page"]:
        required(package, "view", "this")  # before any work is done
    robot = load()
    picture = _picture(robot, load)
    check_rule(redundancy)
    run = None if motion is None else _run(robot, motion, effects, redundancy)
    if plot:
        _write(Shot(robot, picture, size, colours == "file"), run, at, plot)
        return
    _serve(robot, picture, run, redundancy, host, port, browser=not no_browser)


def _picture(robot: HybridRobot, choice: RobotChoice) -> Picture:
    """Build the picture of the robot from the visuals of its file."""
    visuals, notes = read_visuals(choice.robot, choice.xacro_args, choice.package_dirs)
    for note in notes:
        click.echo(f"note: {note}; links without any are drawn in primitive shapes", err=True)
    return draw(robot, visuals, notes)


def _run(robot: HybridRobot, file: str, effects: tuple[str, ...], redundancy: str) -> ShownMotion:
    """Read a motion, and read or compute the efforts along it."""
    found = read_postures(robot, file, redundancy)[1]
    tau, origin = _efforts(robot, file, found, effects)
    step, time = -(-len(found.q) // MOST), found.motion.time
    shown = np.arange(1.0, len(found.q) + 1) if time is None else time
    return ShownMotion(
        shown[::step], found.q[::step], None if tau is None else tau[::step], origin, time is not None
    )


def _efforts(
    robot: HybridRobot, file: str, found: TreeSamples, effects: tuple[str, ...]
) -> tuple[Array | None, str]:
    """Return the efforts along a motion: the table's where it has all of them, else the inverse model's.

    Returns:
        Efforts, shape (T, motors), [N or N m], or None; and their origin, or the reason why there are none.
    """
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


def _write(shot: Shot, run: ShownMotion | None, at: float | None, target: str) -> None:
    """Write a picture or a film, as the ending of the file says."""
    begin, end = (run.begin, run.end) if run else (0.0, 0.0)
    refuse(
        (at is not None and run is None, "--time says a time of a motion, and there is no motion"),
        (
            at is not None and not begin <= at <= end,
            f"--time {at}: the motion goes from {begin:g} to {end:g}",
        ),
    )
    with appearing(target) as draft, progress("pictures") as show:
        if target.lower().endswith(".png"):
            save_png(still(shot, run, at), str(draft))
            return
        frames = frames_around(shot, shot.robot.home) if run is None else frames_of_run(shot, run)
        whole, _ = pictures_of(run)

        def told() -> Iterator[Image]:
            """Yield the frames, and show the progress after each."""
            for count, frame in enumerate(frames):
                show(count + 1, (count + 1) / whole)
                yield frame

        save_mp4(told(), shot.size, str(draft))


def _serve(
    robot: HybridRobot, picture: Picture, run: ShownMotion | None, redundancy: str, host: str, port: int, *,
    browser: bool,
) -> None:  # fmt: skip
    """Serve the page until Ctrl-C."""
    from ..view.page import Page  # pictures need no viser

    page = Page(robot, picture, run, redundancy=redundancy, host=host, port=port)
    try:
        click.echo(f"{robot.name}: {page.url} (Ctrl-C ends it)")
        if browser:
            webbrowser.open(page.url)
        threading.Event().wait()
    except KeyboardInterrupt:
        click.echo("", err=True)
    finally:
        page.close()
