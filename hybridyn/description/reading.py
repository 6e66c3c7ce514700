"""Read a robot file of any supported format into a `Description`: bytes, xacro, XML, the format's reader.

Each format is one entry of `FORMATS`: the name of its root element, and the function that reads this element.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib import import_module
from pathlib import Path

from ..errors import ModelError
from .added_formats import format_of
from .bounds import content_of
from .closure_forms import apply_closing_frames, apply_welded_frames
from .followers import followers_at_home
from .loop_signs import lost_loops, refuse_unclosed_frames
from .motors import choose_motors
from .names import counted, listed
from .notes import placed
from .records import Description, ReadFrom, RobotFile
from .side_cars.beside import files_like, find_loop_closures, find_model_file, find_side_car
from .urdf.xacro import expand
from .urdf.xml_node import XmlNode, parse
from .validate import validate

#: Readers by the name of the root element: a module here, imported only for its format, and a function.
FORMATS = {
    "robot": ("urdf.urdf", "read_urdf"),
    "mujoco": ("mjcf.mjcf", "read_mjcf"),
    "sdf": ("sdf.sdf", "read_sdf"),
    "_usd": ("usd.opening", "read_usd"),
}

#: First bytes of USD files, and the ending that fits. USD is no XML: an empty element `USD` stands for it.
USD_STARTS = {b"#usda": ".usda", b"#sdf": ".usda", b"PXR-USDC": ".usdc", b"PK\x03\x04": ".usdz"}
USD = b"<_usd/>"
#: The same for files of formats that other packages add.
ADDED = b"<_added/>"


def read(
    path: str | os.PathLike[str],
    *,
    motors: Sequence[str] | None = None,
    xacro_args: Mapping[str, object] | None = None,
    package_dirs: Sequence[str | os.PathLike[str]] = (),
    strict: bool = False,
) -> Description:
    """Read a robot file and the files beside it.

    Args:
        path: A URDF, xacro (`.xacro`), MJCF, SDF or USD file; `world.sdf#arm` is one of several models in
            an SDF file.
        motors: Names of the driven joints, in order; None takes them from the files
            (see `motors.choose_motors`).
        xacro_args: Arguments of a xacro file by name.
        package_dirs: Folders that hold packages, for `$(find package)` in xacro, and for files that MJCF
            or SDF includes.
        strict: Whether notes are errors: what was read past, and signs of loops that the files do not state.

    Returns:
        The description of the robot.

    Raises:
        ModelError: A file is invalid; the message names the file, the line and the correction. Or there are
            notes, and this is `strict`; the message lists them.
    """
    root = open_robot(path, xacro_args, package_dirs)
    file, model = split_model(path)
    robot = _read_root(root, model, package_dirs)
    home = _read_beside(robot, file, is_urdf=root.tag == "robot")
    asked = ReadFrom(
        os.fspath(path), None if motors is None else tuple(motors), dict(xacro_args or {}),
        tuple(os.fspath(folder) for folder in package_dirs),
    )  # fmt: skip
    out = replace(complete(robot, motors=motors, home=home, source=file), read_from=asked)
    if strict:
        _refuse_notes(out, file)
    return out


def _read_root(root: XmlNode, model: str, package_dirs: Sequence[str | os.PathLike[str]]) -> RobotFile:
    """Read the root element of a file by the reader of its format; `model`: one of several in SDF, or ""."""
    form = format_of(root.file)
    if form is None and root.tag not in FORMATS:
        part = "this is a part of an MJCF file (MuJoCo); name the file that includes it"
        other = "not a robot file; the root element of a URDF is <robot>, of MJCF <mujoco>, of SDF <sdf>"
        raise root.error(part if root.tag == "mujocoinclude" else other)
    if model and root.tag != "sdf":
        raise ModelError(f"only an SDF file has several models; remove '#{model}'", file=root.file)
    if form is not None:
        return form.read(read_bytes(root.file), root.file)
    module, reader = FORMATS[root.tag]
    content = root.file if root.tag == "_usd" else root  # USD is no XML
    robot: RobotFile = getattr(import_module(f".{module}", __package__), reader)(
        content, package_dirs, *([model] if model else [])
    )
    robot.notes += root.notes
    return robot


def _read_beside(robot: RobotFile, file: str, *, is_urdf: bool) -> dict[str, tuple[float, ...]]:
    """Add what the files beside state, check the whole robot, and return its home posture."""
    if is_urdf:
        _read_side_cars(robot, file)
    home = _read_model_file(robot, file)
    validate(robot)
    if is_urdf:
        refuse_unclosed_frames(robot)
    return home


def _refuse_notes(d: Description, file: str) -> None:
    """Raise if there are notes on a robot, or signs of loops that its file does not state."""
    signs = (f"{sign.message}; {sign.mend}" for sign in lost_loops(d))
    if found := [*d.notes, *signs]:
        every = " ".join(f"({number}) {note}." for number, note in enumerate(found, 1))
        message = f"{counted(len(found), 'note')}, where strict reading allows none: {every}"
        raise ModelError(message, file=file)


def complete(
    robot: RobotFile,
    *,
    motors: Sequence[str] | None = None,
    home: Mapping[str, tuple[float, ...]] | None = None,
    source: str | None = None,
) -> Description:
    """Choose the motors of a valid robot and return its description.

    Args:
        motors: As in `read`.
        home: Home posture; None takes that of the robot.
        source: Path of its file, or None.

    Raises:
        ModelError: A motor is wrong.
    """
    chosen, rule = choose_motors(robot, motors)
    stated = robot.home if home is None else home
    held = followers_at_home(robot.couplings, stated) if robot.format == "URDF" else {}
    return Description(
        name=robot.name,
        links=tuple(robot.links),
        joints=tuple(robot.joints),
        closures=tuple(robot.closures),
        couplings=tuple(robot.couplings),
        motors=chosen,
        motors_from=rule,
        home=dict(stated) | held,
        notes=placed(robot),
        source=source,
        effects=robot.effects,
        base=robot.base,
        base_home=robot.base_home,
        gravity=robot.gravity,
        format=robot.format,
        crossed=dict(robot.crossed),
        left_out=robot.left_out,
    )


def _read_side_cars(robot: RobotFile, file: str) -> None:
    """Add the closures and motors of a side-car, and those that frame names state."""
    side_car, mechanisms = find_side_car(file), files_like(Path(file).parent, "submechanisms.y*ml")
    if side_car is not None:
        from .side_cars.gepetto import read_side_car  # imports pydantic and yaml: 0.1 s

        read_side_car(robot, read_bytes(str(side_car)), str(side_car))
    elif mechanisms:
        from .side_cars.hyrodyn import apply_submechanisms
        from .side_cars.yaml_file import read_yaml

        last = str(mechanisms[-1])
        apply_submechanisms(robot, read_yaml(read_bytes(last), last))
    else:
        apply_welded_frames(robot)
    apply_closing_frames(robot)
    _read_loop_closures(robot, file)


def _read_loop_closures(robot: RobotFile, file: str) -> None:
    """Add the closures of a `loop_closures.yaml`, where nothing else states any."""
    if not (path := find_loop_closures(file)):
        return
    if robot.closures:
        robot.notes.append(f"{path.name} is beside the robot file, which states closures itself; not read")
        return
    from .side_cars.loop_closures import apply_loop_closures
    from .side_cars.yaml_file import read_yaml

    apply_loop_closures(robot, read_yaml(read_bytes(str(path)), str(path)))


def _read_model_file(robot: RobotFile, file: str) -> dict[str, tuple[float, ...]]:
    """Apply model.toml to the robot and return the home posture; it is empty if there is no model.toml."""
    path = find_model_file(file)
    if path is None:
        return robot.home
    from .side_cars.model_toml import apply_model_file, read_model_file

    text = read_bytes(str(path))
    model = read_model_file(text, str(path))
    return robot.home | apply_model_file(robot, model, text.decode("utf-8"), str(path))


def split_model(path: str | os.PathLike[str]) -> tuple[str, str]:
    """Split `world.sdf#arm` into the file and the name of its model, "" where none is named."""
    whole = os.fspath(path)
    file, _, model = whole.rpartition("#")
    return (file, model) if file and model and not os.path.exists(whole) else (whole, "")


def open_robot(
    path: str | os.PathLike[str],
    xacro_args: Mapping[str, object] | None = None,
    package_dirs: Sequence[str | os.PathLike[str]] = (),
) -> XmlNode:
    """Return the root element of a robot file, expanded if it is xacro, with notes of XML and xacro.

    Files that are no XML, USD and those of other packages' formats, have a root without content.

    Raises:
        ModelError: The file cannot be read, is not XML, or xacro reports an error.
    """
    file, _ = split_model(path)
    text = read_bytes(file) if format_of(file) is None else ADDED
    ending = next((ending for start, ending in USD_STARTS.items() if text.startswith(start)), None)
    if ending and not Path(file).suffix.lower().startswith(".usd"):
        raise ModelError(
            f"{'is a ZIP; if it ' if ending == '.usdz' else ''}holds USD, which OpenUSD reads by its ending; "
            f"rename it to end in {ending}",
            file=file,
        )
    root = None if file.endswith(".xacro") else parse(USD if ending else text, file)
    if root is None or root.xml.xpath("boolean(.//*[starts-with(name(), 'xacro:')])"):
        expanded, notes = expand(file, xacro_args or {}, package_dirs)
        root = parse(expanded, file, placed=True)
        root.notes = tuple(notes)
        return root
    if xacro_args:
        raise ModelError(f"is not a xacro file, so it takes no arguments ({listed(xacro_args)})", file=file)
    return root


def read_bytes(file: str) -> bytes:
    """Return the content of a file.

    Raises:
        ModelError: The file cannot be read, is not a regular file, or is too large.
    """
    if os.path.isdir(file):
        raise ModelError("is a folder; name the robot file in it", file=file)
    try:
        return content_of(file)
    except OSError as error:
        raise ModelError(f"cannot be read: {error.strerror}", file=file) from None
    except ValueError as error:
        raise ModelError(f"is not a valid path: {error}", file=file) from None
