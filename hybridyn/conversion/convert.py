"""`convert`: write a robot in another format, by the writer of the file's ending.

A new format is one entry of `WRITERS`: a function that receives a `ConversionRequest`, adds what is lost to
`Losses`, and returns `Written`.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from ..assembly.assemble import assemble_home
from ..description.closure_forms import words_of_rows
from ..description.names import did_you_mean
from ..description.placement import poses_at
from ..description.reading import read
from ..description.records import Description, StatedBase
from ..description.shape_files import MeshFiles, MissingMeshError, Shape, shapes_of, urdf_root
from ..description.shipped import find_robot
from ..description.side_cars.model_toml import find_model_file, find_side_car
from ..description.urdf.xml_node import XmlNode
from ..description.writing import write_text
from ..errors import HybridynError, ModelError
from ..linkage.closures import residual_of
from ..structure.building import build_robot
from ..structure.robot import HybridRobot, positions
from .mjcf import write_mjcf
from .request import TIGHTNESS, ConversionRequest, Losses, Written, home_of
from .sdf import write_sdf
from .urdf import write_urdf
from .usd import write_usd

#: Words of files of other formats that state shapes.
SHAPES = (b"<geom", b"<visual", b"def Mesh", b"def Cube", b"def Sphere", b"def Cylinder", b"def Capsule")


def read_shapes(
    d: Description,
    target: Path,
    xacro_args: Mapping[str, object],
    package_dirs: Sequence[str | os.PathLike[str]],
    losses: Losses,
) -> tuple[Shape, ...]:
    """Read the shapes of a robot's links.

    Args:
        target: The file to be written.
        xacro_args: Arguments of a xacro file by name.
        package_dirs: Folders in which `package://` searches.
        losses: Receives shapes that cannot be read.
    """
    if d.source is None or not Path(d.source).is_file():
        return ()
    if d.format != "URDF":
        if any(word in Path(d.source).read_bytes() for word in SHAPES):
            losses.add("visual shapes, which convert reads from URDF only")
        return ()
    try:
        root = XmlNode(urdf_root(d.source, xacro_args, package_dirs), d.source)
    except ModelError:
        losses.add("visual shapes: the file needs arguments that are not given")
        return ()
    find = MeshFiles(Path(d.source).parent, package_dirs)
    links, out = {link.name for link in d.links}, []
    for shape in shapes_of(root, "visual"):
        if shape.kind in ("", "capsule"):
            losses.add("visual shapes that cannot be read", shape.link)
        elif shape.link in links:
            path = None
            with contextlib.suppress(MissingMeshError):
                path = find(shape.file) if shape.file else None
            out.append(replace(shape, path=path, file=_reference(shape.file, path, target)))
    return tuple(out)


def _reference(file: str, path: Path | None, target: Path) -> str:
    """Return how a file refers to a mesh: the author's address, or the path from the file's own folder."""
    if path is None or file.startswith(("package://", "model://")):
        return file
    return os.path.relpath(path.resolve(), target.resolve().parent)


#: Opening at home that is rounding in the file [rad, or of the robot's size], as in `load`.
ROUNDING = 1e-4

#: Writers by the ending of the file.
WRITERS: dict[str, Callable[[ConversionRequest, Losses], Written]] = {
    ".urdf": write_urdf,
    ".xml": write_mjcf,
    ".sdf": write_sdf,
    ".usda": write_usd,
    ".usd": write_usd,
}
#: Ending of the model file.
MODEL = ".model.toml"
#: Ending of the side-car of a URDF.
SIDE_CAR = ".yaml"
#: Words in each file that `convert` writes; it replaces only such files.
MARK = "written by hybridyn convert"
#: Content of a side-car that says nothing.
NO_SIDE_CAR = "joint_name: []\njoint_type: []\n"


@dataclass(frozen=True)
class Conversion:
    """The result of `convert`.

    Attributes:
        files: Paths of the written files. The first is the robot's file; hybridyn reads the others with it.
        losses: Properties that the format cannot express, one line each, with the names of joints, links
            and closures.
        notes: Remarks that do not concern losses.
    """

    files: tuple[Path, ...]
    losses: tuple[str, ...]
    notes: tuple[str, ...]


def convert(
    robot: HybridRobot | str | os.PathLike[str],
    path: str | os.PathLike[str],
    *,
    base: StatedBase | None = None,
    tightness: float = TIGHTNESS,
    xacro_args: Mapping[str, str] | None = None,
    package_dirs: Sequence[str | os.PathLike[str]] = (),
    strict: bool = False,
) -> Conversion:
    """Write a robot in the format that the ending of a file names: URDF, MJCF (`.xml`), SDF, USD (`.usda`).

    Tree, closures, inertias, limits, motors, effects and home posture are written as far as the format can
    express them. The result lists all other properties. Loops that are open at home are closed first, with
    the motors where they are. Data that only hybridyn reads is written to a file
    beside the output, `robot.xml.model.toml` for `robot.xml`.

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
    """
    target = Path(path)
    writer_of(target)  # an unknown ending is an error before any file is read
    if not (isfinite(tightness) and tightness > 0):
        raise ModelError(f"the tightness is {tightness:g} m; it must be above zero and finite")
    losses, built = Losses(), None
    if isinstance(robot, str | os.PathLike):
        file = find_robot(robot)
        _refuse_replacing(target, file)
        description = read(file, xacro_args=xacro_args, package_dirs=package_dirs, strict=strict)
    else:
        built = robot
        _refuse_replacing(target, robot.description.source)
        if robot.base == "moving" and base is None:
            losses.add("the base moves as prescribed: written as one at rest")
        x, y, z = (float(number) for number in robot.gravity)
        own: StatedBase = "floating" if robot.base == "floating" else "fixed"
        description = replace(robot.description, base=own, gravity=(x, y, z))
    description = replace(description, base=base or description.base)
    description, notes = closed_at_home(description, built)
    shapes = read_shapes(description, target, xacro_args or {}, package_dirs, losses)
    written = write(ConversionRequest(description, target, shapes, tightness), losses)
    return _write(target, replace(written, notes=(*notes, *written.notes)))


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
    raise ModelError(
        f"unknown ending '{ending}'{did_you_mean(ending, WRITERS)}; known: {', '.join(WRITERS)}",
        file=str(target),
    )


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


def closed_at_home(d: Description, robot: HybridRobot | None) -> tuple[Description, tuple[str, ...]]:
    """Return a robot whose loops are closed at home, with its motors where they were, and notes.

    Args:
        robot: The robot that the description belongs to; None to build it where that is needed.

    Raises:
        ModelError: The loops are open at home, and no posture near it closes them.
    """
    open_by, name = max(_openings(d), default=(0.0, ""))
    if open_by <= ROUNDING:
        return d, ()
    opening = f"'{name}' is open at home by {open_by:.2g} (radians, or of the robot's size)"
    try:
        robot = robot or build_robot(d)
        q = assemble_home(robot)
    except HybridynError as error:
        raise ModelError(
            f"{opening}, and no posture near home closes it with the motors where they are ({error}); "
            "state a closed home posture: [home] in model.toml, which 'hybridyn home --at JOINT=NUMBER "
            "--write' finds",
            file=d.source,
            element=name,
        ) from error
    return replace(d, home=positions(robot, q)), (
        f"{opening}; written closed, with the motors where they are",
    )


def _openings(d: Description) -> Iterator[tuple[float, str]]:
    """Yield by how much each closure and coupling is open at home [rad, or of the robot's size]."""
    poses = poses_at(d, d.home)
    size = float(np.ptp([pose[:3, 3] for pose in poses.values()], axis=0).max()) or 1.0
    for closure in d.closures:
        ends = poses[closure.link_a] @ closure.frame_a, poses[closure.link_b] @ closure.frame_b
        a, b = ((M[None, :3, :3], M[None, :3, 3]) for M in ends)
        off = np.abs(residual_of(closure.translations, closure.rotation, a, b)[0])
        off[: len(closure.translations)] /= size
        yield float(off.max(initial=0.0)), closure.name
    at = {joint.name: home_of(d, joint)[0] for joint in d.joints if joint.kind != "fixed"}
    for coupling in d.couplings:
        yield abs(coupling.open_by(at)) / max(abs(factor) for _, factor in coupling.terms), coupling.name


def _refuse_replacing(target: Path, source: str | None) -> None:
    """Refuse, before any work is done, a target that is no file of convert."""
    problem = ""
    if not target.parent.is_dir():
        problem = f"the folder '{target.parent}' does not exist"
    elif target.exists() and not target.is_file():
        problem = "is a folder" if target.is_dir() else "is not a regular file"
    elif target.exists() and source and os.path.exists(source) and os.path.samefile(target, source):
        problem = "is the robot's own file; write to another one"
    elif target.exists() and not target.read_bytes().endswith(_last_line(target).encode()):
        problem = "exists and is not from convert; move it away, or write to another name"
    if problem:
        raise ModelError(problem, file=str(target))


def _write(target: Path, written: Written) -> Conversion:
    """Write the files; one that convert did not write for this target stays as it is."""
    texts = {ending: text for ending, text in written.beside.items() if text}
    files = {ending: file_beside(target, ending) for ending in (MODEL, SIDE_CAR)}
    if find_model_file(str(target)) not in (None, files[MODEL]):
        texts.setdefault(MODEL, "")  # or the other file would be read with the target
    other = find_side_car(str(target)) if target.suffix == ".urdf" else None
    if other not in (None, files[SIDE_CAR]):
        texts.setdefault(SIDE_CAR, NO_SIDE_CAR)
    head = f"# {MARK} for {target.name!a}\n"
    own = [file for file in files.values() if file.exists() and file.read_bytes().startswith(head.encode())]
    for ending, file in files.items():
        if file.exists() and file not in own and (ending in texts or file == other):
            raise ModelError(
                f"is read with {target.name}, but exists and is not from convert; move it away, or write to "
                "another name",
                file=str(file),
            )
    write_text(target, written.text + _last_line(target))
    for ending, file in files.items():
        if ending in texts:
            write_text(file, head + texts[ending])
        elif file in own:
            file.unlink()  # of an earlier conversion
    beside = (file for ending, file in files.items() if ending in texts)
    return Conversion((target, *beside), written.losses, written.notes)


def file_beside(target: Path, ending: str) -> Path:
    """Return the path of a file that is read with a robot's file.

    Args:
        target: The robot's file.
        ending: ".model.toml" or ".yaml".
    """
    return target.with_name(target.name + ending) if ending == MODEL else target.with_suffix(ending)


def _last_line(target: Path) -> str:
    """Return the last line of a robot file from `convert`."""
    return f"# {MARK}\n" if target.suffix.lower().startswith(".usd") else f"<!-- {MARK} -->\n"
