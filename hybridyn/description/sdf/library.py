"""Open the files that an SDF file includes: only local ones, in the robot's folders, within limits."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ...errors import ModelError
from ..shipped import shown
from ..urdf.robot_folders import RobotFolders
from ..urdf.xml_node import LARGEST_FILE, MOST_ELEMENTS, Node, parse
from .schema import READ, Unread, check

#: Oldest and newest version of SDFormat that is read, as (1, minor).
VERSIONS = (4, 12)

#: Most files that one robot may include, each as often as it is included.
MOST_FILES = 1000

#: Deepest nesting of models and of files.
DEEPEST = 50

_VERSION = re.compile(r"1\.(\d{1,3})(\.\d+)?")
_SCHEME = re.compile(r"([A-Za-z][A-Za-z0-9+.-]*)://(.*)", re.DOTALL)


@dataclass(frozen=True)
class Source:
    """A file, and how to understand it.

    Attributes:
        path: Absolute path.
        minor: Its version of SDFormat is 1.minor.
        above: Paths of the files that include it.
    """

    path: str
    minor: int
    above: tuple[str, ...] = ()


class Library:
    """The robot's file and the files that it includes.

    Attributes:
        root: Root element of the robot's own file.
        source: The robot's own file.
        unread: What the files hold that is left out and noted.
    """

    def __init__(self, root: Node, package_dirs: Sequence[str]) -> None:
        """Check the robot's own file.

        Args:
            root: Root element `<sdf>`.
            package_dirs: Folders, beside the robot's own, from which files may be included.

        Raises:
            ModelError: The version is not read, or an element is unknown.
        """
        path = os.path.abspath(root.file)
        self.root = root
        self.unread = Unread()
        self._folders = RobotFolders(path, package_dirs, [], LARGEST_FILE)
        self._files = self._count = self._size = 0
        self.source = Source(path, _minor(root), (path,))
        self._check(root)

    def open(self, node: Node, source: Source) -> tuple[Node, Source]:
        """Return the model of an included file.

        Raises:
            ModelError: The file is not local, cannot be read, includes itself, or holds no single model.
        """
        uri = node.required_child("uri")
        name = uri.content()
        if not name:
            raise uri.error("is empty; name a file or a folder of a model")
        path = self._locate(uri, name, source)
        real = os.path.realpath(path)
        if real in source.above:
            raise uri.error(f"'{name}' includes itself")
        if len(source.above) >= DEEPEST:
            raise uri.error(f"includes are nested more than {DEEPEST} deep")
        content = self._read(uri, name, path)
        self._size += len(content)
        root = parse(content, shown(Path(path)))
        self._refuse_too_much(uri, root)
        if root.tag != "sdf":
            raise uri.error(f"the root element of '{name}' is <{root.tag}> instead of <sdf>")
        inner = Source(path, _minor(root), (*source.above, real))
        self.unread.repaired += root.notes
        self._check(root)
        models = root.children("model")
        if len(models) != 1 or root.children("world"):
            raise uri.error(f"'{name}' holds {len(models)} models; an included file holds one <model>")
        return models[0], inner

    def _check(self, root: Node) -> None:
        waiting = [root]
        while waiting:
            node = waiting.pop()
            check(node, self.unread)
            kind = "axis" if node.tag == "axis2" else node.tag
            known = (child for child in node.children(*READ[kind]) if child.tag != "physics")
            waiting += [child for child in known if child.tag in READ or child.tag == "axis2"]

    def _locate(self, uri: Node, name: str, source: Source) -> str:
        """Return the path of an included file."""
        match = _SCHEME.fullmatch(name)
        scheme, rest = (match[1].lower(), match[2]) if match else ("", name)
        if scheme in ("model", "package"):
            package, _, below = rest.strip("/").partition("/")
            try:
                path = os.path.join(self._folders.find(package), below)
            except ModelError as error:
                raise uri.error(
                    str(error).replace("package", "model" if scheme == "model" else "package", 1)
                ) from None
        elif scheme in ("", "file"):
            path = os.path.normpath(os.path.join(os.path.dirname(source.path), rest))
        else:
            raise uri.error(f"'{name[:80]}' is not a local file; download it, and write its path")
        if os.path.isdir(path):
            path = os.path.join(path, self._file_of_model(uri, name, path))
        return path

    def _file_of_model(self, uri: Node, name: str, folder: str) -> str:
        """Return the name of the SDF file in a folder: the newest that `model.config` states."""
        config = os.path.join(folder, "model.config")
        if not os.path.isfile(config):
            return "model.sdf"
        root = parse(self._read(uri, name, config), shown(Path(config)))
        stated: dict[int, str] = {}
        for node in root.children("sdf"):
            match = _VERSION.fullmatch(str(node.xml.get("version", "1.4")).strip())
            if match and VERSIONS[0] <= int(match[1]) <= VERSIONS[1]:
                stated[int(match[1])] = node.content()
        return stated[max(stated)] if stated else "model.sdf"

    def _read(self, uri: Node, name: str, path: str) -> bytes:
        try:
            return self._folders.read(path)
        except ModelError as error:
            raise uri.error(str(error)) from None
        except (OSError, ValueError) as error:
            reason = error.strerror if isinstance(error, OSError) else str(error)
            raise uri.error(f"'{name[:80]}' cannot be read: {reason}") from None

    def _refuse_too_much(self, uri: Node, root: Node) -> None:
        self._files += 1
        self._count += sum(1 for _ in root.xml.iter("*"))
        if self._files > MOST_FILES or self._count > MOST_ELEMENTS or self._size > LARGEST_FILE:
            raise uri.error(
                f"more than {MOST_FILES} files, {MOST_ELEMENTS} elements or {LARGEST_FILE // 2**20} MiB are "
                "included"
            )


def _minor(root: Node) -> int:
    """Return the minor number of a file's version."""
    text = root.text("version")
    match = _VERSION.fullmatch(text)
    if not match or int(match[1]) > VERSIONS[1]:
        raise root.error(f"version '{text[:20]}' of SDFormat is not read; known: 1.4 to 1.12")
    if int(match[1]) < VERSIONS[0]:
        raise root.error(f"version '{text[:20]}' of SDFormat is too old; convert it with `gz sdf -p`")
    return int(match[1])
