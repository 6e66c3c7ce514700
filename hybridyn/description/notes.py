"""Say of each note in which file, and at which line, what it tells of stands."""

from __future__ import annotations

import re

from .records import Closure, Coupling, Joint, Link, RobotFile

#: How notes with a place begin.
_PLACE = re.compile(r"(?P<file>\S.*?\.\w+)(:(?P<line>\d+))?: (?P<text>.*)", re.DOTALL)
_NAME = re.compile(r"'([^']+)'")


def placed(robot: RobotFile) -> tuple[str, ...]:
    """Return the notes of a robot, each behind its place.

    A note that begins with a file keeps it. The place of others is that of the first element that they name,
    or else the robot's file.
    """
    parts: tuple[Link | Joint | Closure | Coupling, ...] = (
        *robot.links, *robot.joints, *robot.closures, *robot.couplings,
    )  # fmt: skip
    lines = {part.name: part.line for part in reversed(parts) if part.line}
    return tuple(_placed(note, robot.file, lines) for note in robot.notes)


def _placed(note: str, file: str | None, lines: dict[str, int]) -> str:
    if file is None or place_of(note)[0]:
        return note
    line = next((lines[name] for name in _NAME.findall(note) if name in lines), None)
    return f"{file}:{line}: {note}" if line else f"{file}: {note}"


def place_of(note: str) -> tuple[str | None, int | None, str]:
    """Return file, line and text of a note; file and line are None where they are not known."""
    found = _PLACE.match(note)
    if found is None or "'" in found["file"] or "<" in found["file"]:
        return None, None, note
    return found["file"], int(found["line"]) if found["line"] else None, found["text"]
