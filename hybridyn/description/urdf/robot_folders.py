"""Read files for a xacro, MJCF or SDF file, restricted to the robot's folders.

These are the robot's own folder (that of the package around its file, else the file's folder), the packages
that `$(find ...)` names, and the folders that the user names. A symbolic link counts as the file to which it
points. Hidden files, and anything but regular files, are never read.
"""

from __future__ import annotations

import contextlib
import glob
import hashlib
import os
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from ...errors import ModelError, install_advice
from ..bounds import Budget, content_of
from ..shipped import shown
from .packages import STATEMENT, package_folders
from .xml_node import XmlNode, parse

#: Entries that mark the folder of a package: its package file, a folder of robot files, `model.config`.
MARKS = (STATEMENT, "urdf", "xacro", "robots", "meshes", "model.config")

_PACKAGE = re.compile(r"[A-Za-z][\w.-]*")


class RobotFolders:
    """The folders that a robot file may read.

    Args:
        file: The robot file, an absolute path.
        package_dirs: Folders that the user names: packages, or folders of packages.
        share_dirs: Folders of installed packages.
        granted: Further folders that it may read; no packages are searched in them.

    Attributes:
        replies: What was asked, and a hash of each reply.
        closed: Whether all that is asked from now on is refused.
        budget: What the robot takes.
    """

    def __init__(
        self,
        file: str,
        package_dirs: Sequence[str],
        share_dirs: Sequence[str],
        granted: Sequence[str] = (),
    ) -> None:
        self.file, self.budget = file, Budget()
        self.replies, self.closed = list[list[str]](), False
        self.package_dirs = [os.path.abspath(folder) for folder in package_dirs]
        self.share_dirs = list(share_dirs)
        self._real = os.path.realpath(file)
        own = [_own_folder(self._real)]
        if file != self._real:
            own.append(os.path.realpath(_own_folder(file)))
        self._granted = [*own, *map(os.path.realpath, (*self.package_dirs, *granted))]

    def ask(self, what: str, of: str) -> Any:
        """Read a file, find a package, or the files of a pattern ("read", "find", "match").

        Raises:
            OSError: The system cannot open or read the file.
            ModelError: The folders refuse it.
            RunawayError: Too much was asked.
        """
        if self.closed:
            raise ModelError("asks for something after its expansion")
        self.budget.spend("asked", 1)
        reply: Any = None
        try:
            reply = getattr(self, what)(of)
        except (OSError, ModelError) as error:
            reply = str(error)
            raise
        finally:
            self.replies.append([what, of, hashlib.sha256(repr(reply).encode()).hexdigest()])
        return reply

    def give(self, replies: list[list[str]]) -> bool:
        """Return whether they give the same replies to the same questions."""
        for what, of, _ in replies:
            with contextlib.suppress(OSError, ModelError):
                self.ask(what, of)
        return self.replies == replies

    def read(self, path: str) -> bytes:
        """Read a file.

        Raises:
            OSError: The system cannot open or read the file.
            ModelError: The file is outside the robot's folders, hidden, not a regular file, or too large.
        """
        return content_of(self._within(path))

    def find(self, package: str) -> str:
        """Return the folder of a package.

        It is searched in the folders that the user names, above and beside the file, and among the installed
        packages, by the name in its package.xml, else by that of the folder. The file may then read it.

        Raises:
            ModelError: There is no such package.
        """
        if not _PACKAGE.fullmatch(package):
            raise ModelError(f"'{package}' is not a valid package name")
        around = [str(folder) for folder in Path(self.file).parents]
        elsewhere = [*self.package_dirs, *self.share_dirs]
        for folder in package_folders(package, [*self.package_dirs, *around, *self.share_dirs]):
            real = os.path.realpath(folder)
            marked = any(os.path.exists(os.path.join(folder, mark)) for mark in MARKS)
            named = folder in elsewhere or os.path.dirname(folder) in elsewhere
            if named or self._rests(real) or marked:
                self._granted.append(real)
                return os.path.abspath(folder)
        extra = f", or {install_advice('robots')}" if package == "example-robot-data" else ""
        raise ModelError(
            f"package '{package}' is not found; name the folder that holds it with package_dirs{extra}"
        )

    def match(self, pattern: str) -> list[str]:
        """Return the files that a pattern of names describes, in their order.

        Raises:
            ModelError: The folder before the first wildcard is outside the robot's folders, or hidden.
        """
        self._within(os.path.dirname(re.split(r"[*?[]", pattern)[0]))
        return sorted(glob.glob(pattern))

    def _within(self, path: str) -> str:
        """Return the real path of a file; raise ModelError if the file may not be read."""
        real = os.path.realpath(path)
        rests = self._rests(real)
        if real == self._real or not all(any(part[:1] == "." for part in rest) for rest in rests):
            return real
        if rests:
            raise ModelError(f"'{path}' is hidden, and a robot file may not read it")
        raise ModelError(
            f"'{path}' is outside the robot's folders; name the folder that holds it with package_dirs"
        )

    def _rests(self, real: str) -> list[list[str]]:
        """Return a real path from each of the folders that hold it; the system's root is none of them."""
        inside = [
            folder for folder in self._granted if f"{real}/".startswith(f"{folder}/") and folder != os.sep
        ]
        return [real[len(folder) + 1 :].split(os.sep) for folder in inside]


class Includes(RobotFolders):
    """The files that an MJCF or SDF file names, in the robot's folders and within limits."""

    def __init__(self, file: str, package_dirs: Sequence[str], granted: Sequence[str] = ()) -> None:
        super().__init__(file, package_dirs, [], granted)

    def named(self, node: XmlNode, name: str, paths: Iterable[str], mend: str = "") -> tuple[bytes, str]:
        """Read the file that an element names, and return its path, too.

        Args:
            node: The element.
            name: The file as it names it.
            paths: Where the file may be; the first one that can be opened counts.
            mend: What follows in an error.

        Raises:
            ModelError: It cannot be read, or is outside the robot's folders.
        """
        wrong = ""
        for path in dict.fromkeys(map(os.path.normpath, paths)):
            try:
                return self.read(path), path
            except ModelError as error:
                raise node.error(f"{error}{mend}") from None
            except (OSError, ValueError) as error:
                wrong = wrong or str(getattr(error, "strerror", None) or error)
        raise node.error(f"{node.tag} '{name[:80]}' cannot be read: {wrong}{mend}")

    def opened(self, node: XmlNode, name: str, paths: Iterable[str]) -> tuple[XmlNode, str]:
        """Return the root element of a file, and the file's path; the arguments are those of `named`.

        Raises:
            ModelError: It cannot be read, or the robot includes too much.
        """
        content, path = self.named(node, name, paths)
        root = parse(content, shown(Path(path)))
        self.budget.spend("files", 1, node.error)
        self.budget.spend("XML", len(content), node.error)
        self.budget.spend("elements", sum(1 for _ in root.xml.iter("*")), node.error)
        return root, path


def _own_folder(file: str) -> str:
    """Return the folder of the package around a file, else the folder that holds it.

    A folder is a package if it contains package.xml, or if the file is in one of its folders of robot files.
    """
    place, home = os.path.dirname(file), os.path.normpath(os.path.expanduser("~"))
    folder, inner = place, ""
    while folder != os.path.dirname(folder) and not f"{home}{os.sep}".startswith(f"{folder}{os.sep}"):
        if inner in MARKS or os.path.isfile(os.path.join(folder, STATEMENT)):
            return folder
        folder, inner = os.path.split(folder)
    return place
