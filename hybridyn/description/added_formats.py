"""Formats of robot files that other packages add, each for an ending of files."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from ..extensions import Extension, added, running
from .records import RobotFile

#: Endings of hybridyn's own formats, some of which say nothing of the format: the content does.
ENDINGS = (
    "urdf", "xacro", "xml", "mjcf", "sdf", "world", "usd", "usda", "usdc", "usdz", "toml", "yaml", "yml",
    "csv", "parquet",
)  # fmt: skip


class RobotFormat(NamedTuple):
    """A format of robot files.

    Attributes:
        read: Returns the robot of a file, from its content and its path.
        write: Returns what `hybridyn convert` writes, from a `ConversionRequest` and `Losses`; or None.
        comment: A line of comment in such a file, with {} for its text; without, no file is replaced.
    """

    read: Callable[[bytes, str], RobotFile]
    write: Callable[[Any, Any], Any] | None = None
    comment: str = ""


def format_of(file: str | Path) -> RobotFormat | None:
    """Return the format that a package adds for the ending of a file, or None if there is none.

    Raises:
        ModelError: The package cannot be used.
    """
    ending = Path(file).suffix.lower().removeprefix(".")
    found: RobotFormat | None = added("formats", ending) if ending else None
    return found


def checked_format(found: Extension) -> RobotFormat:
    """Return the format that a package adds, whose reader raises errors that name the package.

    Raises:
        ModelError: It is no `RobotFormat`, or its ending has a dot or capitals.
    """
    if not isinstance(found.value, RobotFormat):
        raise found.refused("formats", f"is {found.value!r}: make it a hybridyn.description.RobotFormat")
    if found.name != found.name.lower().strip(". "):
        raise found.refused("formats", "is named by an ending without dot, in small letters")
    write = None if found.value.write is None else partial(_write, found)
    return found.value._replace(read=partial(_read, found), write=write)


def _read(found: Extension, content: bytes, file: str) -> RobotFile:
    """Return the robot of a file.

    Raises:
        ModelError: The reader fails, or returns something else.
    """
    with running("formats", found.name, found.package, file):
        robot = found.value.read(content, file)
    if not isinstance(robot, RobotFile):
        raise found.refused("formats", f"returns {type(robot).__name__} in place of a RobotFile")
    robot.format = "added"
    return robot


def _write(found: Extension, request: Any, losses: Any) -> Any:
    """Return what the writer writes.

    Raises:
        ModelError: It fails, or returns something else.
    """
    with running("formats", found.name, found.package, str(request.target)):
        written = found.value.write(request, losses)
    if not isinstance(getattr(written, "text", None), str):
        raise found.refused("formats", f"writes {type(written).__name__} in place of Written")
    return written
