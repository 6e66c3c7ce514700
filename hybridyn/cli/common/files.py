"""Files that commands read and write: checks before any work, completions in the shell, reports."""

import csv
import glob
import io
import json
import math
import os
from collections.abc import Callable, Iterable, Sequence
from typing import Any, TypeVar

import click

from ...description.names import closest, did_you_mean
from ...description.shipped import (
    BARE_NAME,
    data_names,
    find_data,
    no_such_robot,
    shipped_file,
    shipped_robots,
    shown,
)
from ...description.writing import write_text
from ...errors import HybridynError
from ...tables.bag_folder import is_bag

#: Endings of robots' files, where a scene belongs.
ROBOTS = (".urdf", ".xacro", ".xml", ".sdf", ".usd", ".usda", ".usdc", ".usdz")

Path = TypeVar("Path", str, str | None)


def existing_file(ctx: click.Context, param: click.Parameter, value: Path) -> Path:
    """Check that a file, or a bag, exists if one is named ("-" is standard input); else suggest the nearest.

    A word that is not a path may name a file of a shipped robot, "lx4/traj.csv".
    """
    if value is None or value == "-" or os.path.isfile(value) or is_bag(value):
        return value
    if os.path.exists(value):
        what = "a folder" if os.path.isdir(value) else "not a regular file but a pipe or a device"
        raise click.BadParameter(f"'{value}' is {what}", ctx, param)
    if shipped := find_data(value):
        return shipped
    folder, name = os.path.split(value)
    if folder and not os.path.isdir(folder):
        hint = did_you_mean(value, data_names())
        raise click.BadParameter(f"there is no folder '{folder}'{hint}", ctx, param)
    near = closest(name, os.listdir(folder or "."))
    hint = f" (did you mean '{os.path.join(folder, near)}'?)" if near else ""
    raise click.BadParameter(f"there is no file '{value}'{hint}", ctx, param)


def several(word: str) -> bool:
    """Return whether a word names several tables: it is a folder, or a pattern and no file."""
    return (os.path.isdir(word) and not is_bag(word)) or (glob.has_magic(word) and not os.path.exists(word))


def robot_file(ctx: click.Context, param: click.Parameter, value: str) -> str:
    """Return the file of a robot: an existing file, or that of the shipped robot of this name.

    `world.sdf#arm` is the model `arm` of a file.
    """
    if value.lower().endswith((".csv", ".parquet")):
        raise click.BadParameter(f"'{value}' is a table; the robot comes first", ctx, param)
    file, hash_, _ = value.rpartition("#")
    if hash_ and not os.path.exists(value):
        existing_file(ctx, param, file)
        return value
    if os.path.exists(value) or not BARE_NAME.fullmatch(value):
        return existing_file(ctx, param, value)
    if (found := shipped_file(value)) is None:
        raise click.BadParameter(no_such_robot(value), ctx, param)
    return shown(found)


def complete_robot(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[Any]:
    """Return completions: the shipped robots, and files."""
    from click.shell_completion import CompletionItem  # a command that runs does without

    names = [
        CompletionItem(name, help=robot.what)
        for name, robot in shipped_robots().items()
        if name.startswith(incomplete)
    ]
    return [CompletionItem(incomplete, type="file"), *names]  # bash drops items before a file


def scene_file(ctx: click.Context, param: click.Parameter, value: str) -> str:
    """Return the file of a scene: an existing file, or the scene of the shipped robot of this name."""
    if value.lower().endswith(ROBOTS):
        raise click.BadParameter(f"'{value}' is a robot; a scene is a TOML file (docs/scenes.md)", ctx, param)

    if not os.path.exists(value) and value in shipped_robots():
        robot = shipped_robots()[value]
        if robot.scene:
            return shown(robot.scene)
        names = ", ".join(f"'{value}/{scene.name}'" for scene in robot.scenes) or "none"
        raise click.BadParameter(f"the scenes of '{value}' are: {names}", ctx, param)
    if BARE_NAME.fullmatch(value) and not os.path.exists(value) and closest(value, shipped_robots()):
        raise click.BadParameter(no_such_robot(value), ctx, param)
    return existing_file(ctx, param, value)


def result_file(ctx: click.Context, param: click.Parameter | None, value: str | None) -> str | None:
    """Check, before any work is done, that a result file can be written."""
    if value is None or value == "-":
        return value
    from ...tables.results import check_target  # it imports NumPy, which completion does without

    try:
        check_target(value)
    except HybridynError as error:
        raise click.BadParameter(str(error), ctx, param) from error
    return value


def ends_in(*endings: str) -> Callable[[click.Context, click.Parameter | None, str | None], str | None]:
    """Return a callback that checks the ending and the folder of a file, before any work is done."""

    def check(ctx: click.Context, param: click.Parameter | None, value: str | None) -> str | None:
        """Check the file, if one is named."""
        if value is None:
            return None
        if not value.lower().endswith(endings):
            wanted = " or ".join(endings) if len(endings) < 3 else ", ".join(endings)
            raise click.BadParameter(f"'{value}' must end in {wanted}", ctx, param)
        folder = os.path.dirname(value)
        if folder and not os.path.isdir(folder):
            raise click.BadParameter(f"there is no folder '{folder}'", ctx, param)
        return value

    return check


def check_targets(read: Iterable[str], targets: Iterable[str | None]) -> None:
    """Check that no file is written that the command reads, and none twice.

    Raises:
        click.UsageError: One is.
    """
    sources = {os.path.realpath(path) for path in read if path != "-"}
    taken: set[str] = set()
    for target in targets:
        if target is not None and target != "-":
            place = os.path.realpath(target)
            if place in sources | taken:
                reason = "is read, and would be replaced" if place in sources else "is written already"
                raise click.UsageError(f"'{target}' {reason}")
            taken.add(place)


#: Checks the ending and the folder of a report's file, before any work is done.
report_file = ends_in(".csv", ".json")


def write_report(target: str, rows: Sequence[dict[str, Any]]) -> None:
    """Write rows in the format of the file's ending; the file appears when it is complete.

    Args:
        target: The file, .csv or .json.
        rows: Names and values, None for unknown ones; numbers that are not finite count as unknown.
    """
    rows = [
        {name: None if isinstance(x, float) and not math.isfinite(x) else x for name, x in row.items()}
        for row in rows
    ]
    if target.lower().endswith(".json"):
        write_text(target, json.dumps(rows, indent=2) + "\n")
        return
    text, columns = io.StringIO(), list(dict.fromkeys(name for row in rows for name in row))
    writer = csv.DictWriter(text, columns, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    write_text(target, text.getvalue())


def read_report(source: str) -> list[dict[str, Any]]:
    """Read a report that `write_report` wrote, None where it is empty; of any other file, return no rows."""
    if source.lower().endswith(".json"):
        with open(source, encoding="utf-8") as text:
            found: list[dict[str, Any]] = json.load(text)
        return found
    if not source.lower().endswith(".csv"):
        return []
    with open(source, encoding="utf-8", newline="") as text:
        reader = csv.DictReader(text)
        known = {"motor", "joint", "setting"} & {*(reader.fieldnames or ())}
        return [{name: x or None for name, x in row.items()} for row in reader] if known else []
