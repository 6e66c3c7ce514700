"""The files that convert writes: which it may replace, and what is read with them."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from ..description.added_formats import format_of
from ..description.side_cars.beside import find_model_file, find_side_car
from ..description.writing import write_text
from ..errors import ModelError
from .request import Written

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

    Example:
        >>> from tempfile import TemporaryDirectory
        >>> with TemporaryDirectory() as folder:
        ...     done = hybridyn.convert("five_bar", f"{folder}/five_bar.sdf")
        >>> len(done.files), done.losses
        (2, ())
    """

    files: tuple[Path, ...]
    losses: tuple[str, ...]
    notes: tuple[str, ...]


def refuse_replacing(target: Path, source: str | None) -> None:
    """Refuse, before any work is done, a target that is no file of convert."""
    problem = ""
    if not target.parent.is_dir():
        problem = f"the folder '{target.parent}' does not exist"
    elif target.exists() and not target.is_file():
        problem = "is a folder" if target.is_dir() else "is not a regular file"
    elif target.exists() and source and os.path.exists(source) and os.path.samefile(target, source):
        problem = "is the robot's own file; write to another one"
    elif target.exists() and not (
        (last := _last_line(target)) and target.read_bytes().endswith(last.encode())
    ):
        problem = "exists and is not from convert; move it away, or write to another name"
    if problem:
        raise ModelError(problem, file=str(target))


def write_files(target: Path, written: Written) -> Conversion:
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
    if (form := format_of(target)) is not None:
        return f"{form.comment.format(MARK)}\n" if form.comment else ""
    return f"# {MARK}\n" if target.suffix.lower().startswith(".usd") else f"<!-- {MARK} -->\n"
