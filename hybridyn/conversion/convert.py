"""`convert`: write a robot in another format."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING

from ..description import Description, read
from ..description.records import StatedBase
from ..description.shipped import find_robot
from ..description.side_cars.companions import find_model_file, own_model_file
from ..description.writing import write_text
from ..errors import ModelError
from .losses import Losses
from .model_file import HEAD
from .request import TIGHTNESS, Request, Written
from .shapes import read_shapes
from .writers import writer_of

if TYPE_CHECKING:
    from ..structure.robot import HybridRobot

#: Ending of the model file.
MODEL = ".model.toml"


@dataclass(frozen=True)
class Conversion:
    """What `convert` wrote.

    Attributes:
        files: The files, the robot's first; the others stand beside it and hybridyn reads them with it.
        losses: What the format cannot say, one line each, with the names of joints, links and closures.
        notes: Remarks that are no losses.
    """

    files: tuple[Path, ...]
    losses: tuple[str, ...]
    notes: tuple[str, ...]


def convert(
    robot: HybridRobot | str | os.PathLike[str],
    path: str | os.PathLike[str],
    *,
    tightness: float = TIGHTNESS,
    xacro_args: Mapping[str, str] | None = None,
    package_dirs: Sequence[str | os.PathLike[str]] = (),
) -> Conversion:
    """Write a robot in the format that the ending of a file names: URDF, MJCF (`.xml`), SDF, USD (`.usda`).

    Tree, closures, inertias, limits, motors, effects and home are written as far as the format can say them;
    what it cannot is listed. A `model.toml` beside the file holds what only hybridyn reads.

    Args:
        robot: A robot, with its own base and gravity; or a file of any format that `load` reads; or the name
            of a shipped robot.
        path: The file to be written.
        tightness: Distance by which closures may open in a simulator that holds them with springs [m].
        xacro_args: Arguments of a xacro file by name.
        package_dirs: Folders that hold packages, as for `load`.

    Returns:
        The written files and what was lost.

    Raises:
        ModelError: The robot cannot be read, no writer has this ending, the folder does not exist, or a file
            would be replaced that the robot comes from or that another program wrote.
        OSError: A file cannot be written.
    """
    target = Path(path)
    writer = writer_of(target)
    _check_target(target)
    if not (isfinite(tightness) and tightness > 0):
        raise ModelError(f"the tightness is {tightness:g} m; it must be above zero and finite")
    if isinstance(robot, str | os.PathLike):
        file = find_robot(robot)
        _refuse_input(target, file)
        description = read(file, xacro_args=xacro_args, package_dirs=package_dirs)
    else:
        description = _as_loaded(robot)
        if description.source is not None:
            _refuse_input(target, description.source)
    losses = Losses()
    shapes = read_shapes(description, target, xacro_args or {}, package_dirs, losses)
    written = writer(Request(description, target, shapes, tightness))
    return _write(description, target, replace(written, losses=(*written.losses, *losses.lines())))


def _as_loaded(robot: HybridRobot) -> Description:
    """Return the description of a robot with the base and the gravity that it was loaded with."""
    x, y, z = (float(number) for number in robot.gravity)
    base: StatedBase = "floating" if robot.base == "floating" else "fixed"
    return replace(robot.description, base=base, gravity=(x, y, z))


def _check_target(target: Path) -> None:
    """Check, before any work is done, that a file can be written.

    Raises:
        ModelError: It is a folder or no regular file, or its folder does not exist.
    """
    if target.exists() and not target.is_file():
        raise ModelError("is a folder" if target.is_dir() else "is not a regular file", file=str(target))
    if not target.parent.is_dir():
        raise ModelError(f"the folder '{target.parent}' does not exist", file=str(target))


def _refuse_input(target: Path, source: str) -> None:
    """Refuse to replace the robot's own file.

    Raises:
        ModelError: They are the same file.
    """
    if target.exists() and os.path.exists(source) and os.path.samefile(target, source):
        raise ModelError("is the robot's own file; write to another one", file=str(target))


def _write(description: Description, target: Path, written: Written) -> Conversion:
    """Write the files; one that convert did not write stays as it is.

    Raises:
        ModelError: A file beside the target has to be written, but another program wrote it.
    """
    model = own_model_file(str(target))
    stem = model.name.removesuffix(".model.toml")
    own = find_model_file(description.source) if description.source else None
    notes = list(written.notes)
    beside: dict[Path, str] = {}
    for ending in (MODEL, *(key for key in written.beside if key != MODEL)):
        file, text = target.with_name(stem + ending), written.beside.get(ending, "")
        if not file.exists() or file.read_text(encoding="utf-8", errors="replace").startswith(HEAD):
            beside[file] = text
        elif own is not None and own.exists() and os.path.samefile(file, own):
            notes.append(
                f"{file} belongs to the robot that was converted, and is read with {target.name}, too"
            )
        elif text:
            raise ModelError(
                f"has to be written with {target.name}, but exists and is not from convert; move it away, "
                "or write to another name",
                file=str(file),
            )
        else:
            notes.append(f"{file} is read with {target.name}, and ranks above it")
    write_text(target, written.text)
    for file, text in beside.items():
        if text:
            write_text(file, text)
        else:
            file.unlink(missing_ok=True)  # of an earlier conversion
    files = (target, *(file for file, text in beside.items() if text))
    return Conversion(files, written.losses, tuple(notes))
