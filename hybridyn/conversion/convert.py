"""`convert`: write a robot in another format, by the writer of the file's ending.

A new format is one entry of `WRITERS`: a function that receives a `ConversionRequest`, adds what is lost to
`Losses`, and returns `Written`.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import isfinite
from pathlib import Path
from typing import Any

from ..description.added_formats import format_of
from ..description.closure_forms import words_of_rows
from ..description.names import did_you_mean
from ..description.reading import read
from ..description.records import Description, StatedBase
from ..description.shipped import find_robot
from ..errors import ModelError
from ..extensions import added_names
from ..structure.robot import HybridRobot
from .closed_home import closed_at_home
from .mjcf import write_mjcf
from .request import TIGHTNESS, ConversionRequest, Losses, Written
from .sdf import write_sdf
from .shapes import read_shapes
from .target_files import Conversion, refuse_replacing, write_files
from .urdf import write_urdf
from .usd import write_usd

#: Writers by the ending of the file.
WRITERS: dict[str, Callable[[ConversionRequest, Losses], Written]] = {
    ".urdf": write_urdf,
    ".xml": write_mjcf,
    ".sdf": write_sdf,
    ".usda": write_usd,
    ".usd": write_usd,
}


def convert(
    robot: HybridRobot | str | os.PathLike[str], path: str | os.PathLike[str], *,
    base: StatedBase | None = None, tightness: float = TIGHTNESS,
    xacro_args: Mapping[str, str] | None = None, package_dirs: Sequence[str | os.PathLike[str]] = (),
    strict: bool = False,
) -> Conversion:  # fmt: skip
    """Write a robot in the format that the ending of a file names: URDF, MJCF (`.xml`), SDF, USD (`.usda`).

    Tree, closures, inertias, limits, motors, effects and home posture are written as far as the format can
    express them. The result lists all other properties. Loops that are open at home are closed first, with
    the motors where they are. Data that only hybridyn reads is written to a file beside the output,
    `robot.xml.model.toml` for `robot.xml`.

    Args:
        robot: A robot, with its own base and gravity; or a file of any format that `load` reads; or the name
            of a shipped robot.
        path: The file to be written.
        base: "fixed" or "floating"; None uses the base of the robot.
        tightness: Distance by which closures may open in a simulator that holds them with springs [m].
        xacro_args: Arguments of a xacro file by name.
        package_dirs: Folders that hold packages, as for `load`.
        strict: Whether notes of the reader are errors, as for `load`.

    Returns:
        The written files, the losses and the notes.

    Raises:
        ModelError: The robot cannot be read, the ending names no format, the folder does not exist, or a file
            would be replaced that belongs to the robot or that `convert` did not write; or loops are open
            at home, and no posture near it closes them.
        OSError: A file cannot be written.

    Example:
        >>> from tempfile import TemporaryDirectory
        >>> with TemporaryDirectory() as folder:
        ...     done = hybridyn.convert("five_bar", f"{folder}/five_bar.sdf")
        >>> done.losses
        ()
    """
    target = Path(path)
    writer_of(target)  # an unknown ending is an error before any file is read
    if not (isfinite(tightness) and tightness > 0):
        raise ModelError(f"the tightness is {tightness:g} m; it must be above zero and finite")
    losses = Losses()
    if isinstance(robot, str | os.PathLike):
        built, file = None, find_robot(robot)
        refuse_replacing(target, file)
        description = read(file, xacro_args=xacro_args, package_dirs=package_dirs, strict=strict)
    else:
        built, description = robot, _as_loaded(robot)
        refuse_replacing(target, description.source)
        if robot.base == "moving" and base is None:
            losses.add("the base moves as prescribed: written as one at rest")
    description, notes = closed_at_home(replace(description, base=base or description.base), built)
    shapes = read_shapes(description, target, xacro_args or {}, package_dirs, losses)
    written = write(ConversionRequest(description, target, shapes, tightness), losses)
    return write_files(target, replace(written, notes=(*notes, *written.notes)))


def _as_loaded(robot: HybridRobot) -> Description:
    """Return the description of a robot with its own base and gravity; a moving base is fixed."""
    x, y, z = (float(number) for number in robot.gravity)
    own: StatedBase = "floating" if robot.base == "floating" else "fixed"
    return replace(robot.description, base=own, gravity=(x, y, z))


def write(request: ConversionRequest, losses: Losses) -> Written:
    """Return the text of a robot's file, the files beside it, and what is lost.

    Args:
        losses: What is lost already.

    Raises:
        ModelError: No writer has this ending, or the format cannot hold the robot.
    """
    d = _sayable(request.description, losses)
    written = writer_of(request.target)(replace(request, description=d), losses)
    return replace(written, losses=losses.lines())


def writer_of(target: Path) -> Callable[[ConversionRequest, Losses], Written]:
    """Return the writer of a file.

    Raises:
        ModelError: No writer has this ending.
    """
    ending = target.suffix.lower()
    if ending in WRITERS:
        return WRITERS[ending]
    if (form := format_of(target)) is None:
        known = [*WRITERS, *(f".{name}" for name in added_names("formats"))]
        raise ModelError(
            f"unknown ending '{ending}'{did_you_mean(ending, known)}; known: {', '.join(known)}",
            file=str(target),
        )
    if form.write is None:
        raise ModelError(f"the format of '{ending}' has no writer: it is only read", file=str(target))
    return form.write


def _sayable(d: Description, losses: Losses) -> Description:
    """Return a robot without what no format says: closures without rows, terms of couplings that are zero.

    Args:
        losses: Receives what is left out.

    Raises:
        ModelError: No file can hold a name.
    """
    d = replace(d, name=d.name or "robot")
    parts: list[Any] = [d, *d.links, *d.joints, *d.closures, *d.couplings]
    if bad := [x.name for x in parts if not (x.name.isprintable() and x.name == x.name.strip() != "")]:
        raise ModelError(
            f"the name {bad[0]!r} cannot be written: it is empty, or has blanks at its ends or a tab, line "
            "break or control character; rename it",
            file=d.source,
            element=bad[0],
        )
    rowless = [c.name for c in d.closures if not words_of_rows(c.translations, c.rotation)]
    for reason, names in (
        ("position limits of which the lower is above the upper", d.crossed),
        ("which part of a link is an added body", [load.name for load in d.loads]),
        ("closures left out, since they have no row", rowless),
    ):
        for name in names:
            losses.add(reason, name)
    return replace(
        d,
        closures=tuple(closure for closure in d.closures if closure.name not in rowless),
        couplings=tuple(
            replace(c, terms=tuple((name, factor) for name, factor in c.terms if factor)) for c in d.couplings
        ),
    )
