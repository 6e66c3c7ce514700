"""The folders from which a xacro file may read, and reading from them.

They are the robot's own folder (that of the package around its file, else the file's), the packages that
`$(find ...)` names, and the folders that the user names. A link counts as the file to which it leads. Hidden
files, and what is no regular file, are never read.
"""

from __future__ import annotations

import errno
import fnmatch
import os
import re
import stat
from collections.abc import Iterator, Sequence
from pathlib import Path

from ...errors import ModelError

#: What the folder of a package holds: the file that names it, or a folder of robot files.
MARKS = ("package.xml", "urdf", "xacro", "robots", "meshes")

#: Most folders and files that a pattern of names looks at.
MOST_LOOKED_AT = 10_000

_PACKAGE = re.compile(r"[A-Za-z][\w.-]*")
_WILD = re.compile(r"[*?\[]")


class RobotFolders:
    """What a robot file may read.

    Args:
        file: The robot file, an absolute path.
        package_dirs: Folders that the user names: packages, or folders of packages.
        share_dirs: Folders of installed packages.
        largest: Largest file that is read [bytes].
        granted: Further folders that it may read, in which no packages are looked for.
    """

    def __init__(
        self,
        file: str,
        package_dirs: Sequence[str],
        share_dirs: Sequence[str],
        largest: int,
        granted: Sequence[str] = (),
    ) -> None:
        self.file, self.largest = file, largest
        self.package_dirs = [os.path.abspath(folder) for folder in package_dirs]
        self.share_dirs = list(share_dirs)
        spellings = (file, os.path.realpath(file))
        own = [_own_folder(spelling) for spelling in spellings]
        self._granted = [os.path.realpath(folder) for folder in (*own, *self.package_dirs, *granted)]

    def read(self, path: str) -> bytes:
        """Read a file.

        Raises:
            OSError: The system does not give it.
            ModelError: It lies outside the robot's folders, is no regular file, or is too large.
        """
        handle = os.open(self._within(path), os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        with os.fdopen(handle, "rb") as file:
            about = os.fstat(file.fileno())
            if not stat.S_ISREG(about.st_mode):
                raise ModelError(f"'{path}' is not a regular file")
            if about.st_size > self.largest:
                raise ModelError(f"'{path}' is larger than {self.largest // 2**20} MiB")
            return file.read(self.largest)

    def glob(self, pattern: str) -> list[str]:
        """Return the files that a pattern of names fits, sorted.

        Raises:
            ModelError: It looks outside the robot's folders, or at too many files.
        """
        parts = Path(os.path.normpath(pattern)).parts
        first_wild = next((i for i, part in enumerate(parts) if _WILD.search(part)), len(parts))
        start = os.path.join(*parts[:first_wild])
        self._within(start)
        found = []
        for count, (path, fits) in enumerate(_fitting(start, parts[first_wild:])):
            if count > MOST_LOOKED_AT:
                raise ModelError(f"'{pattern}' looks at more than {MOST_LOOKED_AT:,} files")
            if fits:
                found.append(path)
        return sorted(found)

    def find(self, package: str) -> str:
        """Find a package: in the folders that the user names, above and beside the file, or installed.

        Raises:
            ModelError: There is none.
        """
        if not _PACKAGE.fullmatch(package):
            raise ModelError(f"'{package}' is no name of a package")
        around = [str(folder) for folder in Path(self.file).parents]
        for place in (*self.package_dirs, *around, *self.share_dirs):
            inside = os.path.join(place, package)
            for folder in (place, inside):
                if os.path.basename(folder) == package and os.path.isdir(folder):
                    if place in around and not self._granted_already(folder) and not _is_package(folder):
                        continue
                    self._granted.append(os.path.realpath(folder))
                    return os.path.abspath(folder)
        raise ModelError(f"package '{package}' is not found; name the folder that holds it with package_dirs")

    def _granted_already(self, path: str) -> bool:
        real = os.path.realpath(path)
        return any(_inside(real, folder) is not None for folder in self._granted)

    def _within(self, path: str) -> str:
        """Return the file to which a path leads, if it may be read."""
        real = os.path.realpath(path)
        if real == os.path.realpath(self.file):
            return real
        rests = [rest for folder in self._granted if (rest := _inside(real, folder)) is not None]
        if any(not _is_hidden(rest) for rest in rests):
            return real
        if rests:
            raise ModelError(f"'{path}' is hidden, and a xacro file may not read it")
        raise ModelError(
            f"'{path}' lies outside the robot's folders; name the folder that holds it with package_dirs"
        )


def _own_folder(file: str) -> str:
    """Return the folder of the package around a file, else the folder that holds it.

    A folder is a package if it holds package.xml, or the file in its folder of robot files.
    """
    place = Path(file).parent
    home = Path(os.path.expanduser("~"))
    for folder in (place, *place.parents):
        if folder == folder.parent or home.is_relative_to(folder):
            break
        below = place.relative_to(folder).parts
        if (folder / MARKS[0]).is_file() or (below and below[0] in MARKS):
            return str(folder)
    return str(place)


def _is_package(folder: str) -> bool:
    return any(os.path.exists(os.path.join(folder, mark)) for mark in MARKS)


def _is_hidden(path: Path) -> bool:
    return any(part.startswith(".") for part in path.parts)


def _inside(path: str, folder: str) -> Path | None:
    """Return the part of a path inside a folder, or None where it lies outside."""
    if folder == os.sep:  # a robot that lies there has no folder of its own
        return None
    return Path(path).relative_to(folder) if Path(path).is_relative_to(folder) else None


def _fitting(folder: str, parts: tuple[str, ...]) -> Iterator[tuple[str, bool]]:
    """Yield each path that is looked at for a pattern, and whether the pattern fits it."""
    if not parts:
        yield folder, os.path.lexists(folder)
        return
    first, *rest = parts
    if _WILD.search(first):
        try:
            names = sorted(os.listdir(folder))
        except OSError as error:
            if error.errno in (errno.ENOENT, errno.ENOTDIR, errno.EACCES):
                return
            raise
    else:
        names = [first]
    for name in names:
        path = os.path.join(folder, name)
        yield path, False
        if name == first or (fnmatch.fnmatchcase(name, first) and not name.startswith(".")):
            yield from _fitting(path, tuple(rest))
