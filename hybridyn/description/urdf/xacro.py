"""Expand xacro files: they run no code, write nothing, and read no file outside the robot's folders.

An expansion without arguments is kept in the cache folder. One with arguments is traced: other arguments of
the same names need no expansion, but where xacro chooses something else.
"""

from __future__ import annotations

import contextlib
import os
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING

from ..bounds import RunawayError
from ..cache_folder import hashed, keep, kept, state_of
from ..shipped import data_folder
from .robot_folders import RobotFolders

if TYPE_CHECKING:
    from .expansion import Expansion

#: Most expansions with arguments that are traced.
MOST_TRACED = 16

#: Expansions with arguments by file, folders and names, the last one last; None cannot be traced.
_traced: list[tuple[tuple[str, ...], Expansion | None]] = []
#: A traced expansion serves one call at a time.
_lock = threading.Lock()


def expand(
    file: str, arguments: Mapping[str, object], package_dirs: Sequence[str | os.PathLike[str]]
) -> tuple[bytes, list[str]]:
    """Expand a xacro file; return the XML, whose elements have a `PLACE`, and xacro's warnings as notes.

    What is known of an expansion is used again while all that it asked of the robot's folders gets the same
    replies.

    Raises:
        ModelError: xacro reports an error, or the expansion makes too much; the message names the file and
            the macro.
    """
    path = os.path.abspath(file)
    named = [os.fspath(folder) for folder in package_dirs]
    given = {str(name): str(value) for name, value in arguments.items()}
    shipped = data_folder()  # every robot may include modules of the shipped ones
    granted = [str(shipped / "urdf")] if shipped else []
    fresh = partial(RobotFolders, path, named, share_dirs(), granted)
    about = (path, os.getcwd(), *named)
    with _lock:
        written, notes = (
            _with_arguments(file, given, fresh, (*about, "", *given)) if given else _alone(file, fresh, about)
        )
    return written.encode(), notes


def _alone(file: str, fresh: Callable[[], RobotFolders], about: Sequence[str]) -> tuple[str, list[str]]:
    """Expand a file without arguments, or return the expansion that is kept."""
    name = hashed(sys.version, *about, state_of(__package__))
    known = kept(name)
    if known is None or not fresh().give(known["replies"]):
        made = _expanded(file, fresh(), {}, False)
        known = {"replies": made.folders.replies, "text": made.text, "notes": made.notes}
        keep(name, known)
    return known["text"], known["notes"]


def _with_arguments(
    file: str, given: Mapping[str, str], fresh: Callable[[], RobotFolders], about: tuple[str, ...]
) -> tuple[str, list[str]]:
    """Expand a file with arguments, of which a study has many: by a traced expansion, if one serves."""
    known = [one for key, one in reversed(_traced) if key == about]
    for one in filter(None, known):
        with contextlib.suppress(Exception):
            if fresh().give(one.folders.replies):
                return one.again(given), one.notes
    made: Expansion | None = None
    if None not in known:
        try:
            made = _expanded(file, fresh(), given, True)
        except RunawayError:  # would run away once more
            raise
        except Exception:
            made = None
    found = made or _expanded(file, fresh(), given, False)
    _traced.append((about, made))
    del _traced[:-MOST_TRACED]
    return found.text, found.notes


def _expanded(file: str, folders: RobotFolders, given: Mapping[str, str], traced: bool) -> Expansion:
    """Expand a file."""
    from .expansion import Expansion  # what is kept needs no yaml

    return Expansion(file, folders, given, traced=traced)


def share_dirs() -> list[str]:
    """Return the folders in which installed packages keep robot files: pip's and the system's."""
    pip = [os.path.join(entry, "cmeel.prefix", "share") for entry in sys.path if entry]
    return [*filter(os.path.isdir, (*pip, os.path.join(sys.prefix, "share")))]
