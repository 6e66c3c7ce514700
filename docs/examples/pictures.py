"""What the examples share: their options, pictures of a robot, and where their figure goes."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import hybridyn
from hybridyn.view.camera import camera_around
from hybridyn.view.drawing import draw
from hybridyn.view.placing import extent, place_bodies
from hybridyn.view.render import render
from hybridyn.view.visuals import read_visuals

HERE = Path(__file__).parent
INK = "#30353c"
COLOURS = ("#3b7dd8", "#e8743b", "#2a9d8f", "#b5489c", "#7a9e2e", "#d1495b", "#6f5fc6", "#00a5c8")


class Options(NamedTuple):
    """What an example was asked for.

    Attributes:
        short: Whether a fraction of the work will do.
        folder: Where the figure goes.
        number: How many designs or samples are computed; 0 where the example has none.
    """

    short: bool
    folder: Path
    number: int = 0


def options(
    what: str | None, words: list[str] | None = None, number: tuple[str, int, int] | None = None
) -> Options:
    """Read the options of an example.

    Args:
        what: What the example does.
        words: The words after its name; None takes those of the program.
        number: Name of a number, its value for the picture, and that for a short run.
    """
    parser = argparse.ArgumentParser(description=what, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--short", action="store_true", help="do a fraction of the work")
    parser.add_argument("--to", type=Path, default=HERE, metavar="FOLDER", help="where the picture goes")
    if number is not None:
        name, usual, few = number
        help_ = f"number of {name} [{usual}; {few} if short]"
        parser.add_argument(f"--{name}", dest="number", type=int, metavar="N", help=help_)
    given = parser.parse_args(words)
    if number is None:
        return Options(given.short, given.to)
    return Options(given.short, given.to, given.number or (few if given.short else usual))


def snapshots(
    axes: list[Axes],
    robot: hybridyn.HybridRobot,
    postures: list[np.ndarray],
    *,
    turn: float = -0.9,
    lift: float = 0.3,
    meshes: bool = False,
) -> None:
    """Draw a robot in several postures, all from one place.

    Args:
        axes: Where, one each.
        robot: The robot.
        postures: Its positions, shape (nq,) each.
        turn: Direction from which it is seen, about the vertical [rad].
        lift: Height from which it is seen, as an angle [rad].
        meshes: Whether links look as the robot's files say, where rods would do.
    """
    shapes, notes = read_visuals(robot.description.source or "", {}, []) if meshes else ([], [])
    picture = draw(robot, shapes, notes)
    places = [place_bodies(robot, q) for q in postures]
    boxes = np.array([extent(picture, place) for place in places])
    corners = np.array([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])
    for axis, place in zip(axes, places, strict=True):
        box = axis.get_position()
        inches = axis.figure.get_size_inches()
        height = 420
        width = round(height * (box.width * inches[0]) / (box.height * inches[1]))
        axis.imshow(render(picture, place, camera_around(corners, width, height, turn=turn, lift=lift)))
        axis.set_axis_off()


def figure(width: float, height: float) -> Figure:
    """Return an empty figure, in inches."""
    return Figure(figsize=(width, height))


def row(picture: Figure, count: int, bottom: float, height: float, *, views: bool = False) -> list[Axes]:
    """Return axes side by side, `bottom` and `height` in parts of the figure; `views` need no numbers."""
    left, gap = (0.01, 0.01) if views else (0.075, 0.085)
    width = (0.985 - left - (count - 1) * gap) / count
    return [picture.add_axes((left + i * (width + gap), bottom, width, height)) for i in range(count)]


def plain(axis: Axes, title: str, unit: str, across: str = "time [s]") -> None:
    """Return an axis its title and units, and take away what says nothing."""
    axis.set_title(title, loc="left", fontsize=9, color=INK)
    axis.set_xlabel(across, fontsize=8, color=INK)
    axis.set_ylabel(unit, fontsize=8, color=INK)
    axis.tick_params(labelsize=7, colors=INK, which="both")
    axis.grid(color="#e2e5e9", linewidth=0.6)
    axis.set_axisbelow(True)
    for side in ("top", "right"):
        axis.spines[side].set_visible(False)


def save(picture: Figure, options: Options, name: str) -> Path:
    """Write a figure in few colours, so that it stays small, and give its file."""
    from PIL import Image

    path = options.folder / f"{name}.png"
    picture.savefig(path, dpi=110)
    Image.open(path).convert("RGB").quantize(128).save(path, optimize=True)
    return path
