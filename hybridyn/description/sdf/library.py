"""The files of an SDF robot: which model is the robot, and the files that it includes.

Included files are local ones, in the robot's folders, within limits.
"""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from pathlib import Path

from ...errors import ModelError
from ..names import listed
from ..shipped import shown
from ..urdf.robot_folders import RobotFolders
from ..urdf.xml_node import LARGEST_FILE, MOST_ELEMENTS, Node, parse
from .elements import Notes, check, flag, word

#: Oldest and newest version of SDFormat that is read, as (1, minor).
VERSIONS = (4, 12)

#: Most files that one robot may include, each as often as it is included.
MOST_FILES = 1000

#: Deepest nesting of models and of files.
DEEPEST = 50

#: Models of Gazebo that are only scenery; they are not opened.
SCENERY = ("sun", "ground_plane")

ONE_ROBOT = "hybridyn reads one robot: remove the others, or nest them in one <model>"

STATIC = (
    "a static model does not move at all, nor do its joints; to hold only its base, remove <static> and "
    "write a fixed joint with <parent>world</parent>"
)

_VERSION = re.compile(r"1\.(\d{1,3})(\.\d+)?")
_SCHEME = re.compile(r"([A-Za-z][A-Za-z0-9+.-]*)://(.*)", re.DOTALL)

#: Paths of a file and of those that include it, the outermost first.
Files = tuple[str, ...]

#: The element that places a model (`<include>`, or the model itself), the model, and the files around it.
Placed = tuple[Node, Node, Files]


class Library:
    """The robot's file and the files that it includes.

    Attributes:
        root: Root element of the robot's own file.
        own: The robot's own file.
        notes: What the files hold that is left out and noted.
    """

    def __init__(self, root: Node, package_dirs: Sequence[str | os.PathLike[str]]) -> None:
        """Check the robot's own file.

        Args:
            root: Root element `<sdf>`.
            package_dirs: Folders, beside the robot's own, from which files may be included.

        Raises:
            ModelError: The version is not read, or an element is unknown.
        """
        self.root, self.notes = root, Notes()
        self.own: Files = (os.path.abspath(root.file),)
        folders = [os.fspath(folder) for folder in package_dirs]
        self._folders = RobotFolders(self.own[0], folders, [], LARGEST_FILE)
        self._files = self._count = self._size = 0
        minor_of(root)
        check(root, self.notes)

    def robot(self) -> Placed:
        """Return the only model that can move; note the static ones.

        Raises:
            ModelError: There is no such model, or there are several.
        """
        worlds, models = self.root.children("world"), self.root.children("model")
        if len(worlds) > 1 or (worlds and models):
            names = listed(node.text("name") for node in (*worlds, *models))
            raise self.root.error(f"{len(worlds) + len(models)} worlds and models: {names}; {ONE_ROBOT}")
        found: list[Placed] = []
        still: list[str] = []
        for own in worlds[0].children("model", "include") if worlds else models:
            if own.tag == "include" and _name(own) in SCENERY:
                still.append(_name(own))
                continue
            model, files = self.open(own, self.own)
            if flag(own, "static", flag(model, "static")):
                still.append(name_of(own, model))
            else:
                found.append((own, model, files))
        if not found:
            static = f"no model that moves, only {listed(still)}; {STATIC}"
            raise self.root.error(static if still else "no <model>; a robot is one")
        if len(found) > 1:
            names = listed(name_of(own, model) for own, model, _ in found)
            raise self.root.error(f"{len(found)} models that move: {names}; {ONE_ROBOT}")
        self.notes["static models are left out: {}"] = still
        return found[0]

    def open(self, node: Node, files: Files) -> tuple[Node, Files]:
        """Return the model of an `<include>` with the files around it, or a model itself.

        Raises:
            ModelError: The file is not local, cannot be read, includes itself, or holds no single model.
        """
        if node.tag != "include":
            return node, files
        uri = node.required_child("uri")
        name = uri.content()
        try:
            path = self._locate(name, files[-1])
            if os.path.realpath(path) in map(os.path.realpath, files):
                raise ModelError(f"'{name}' includes itself")
            if len(files) >= DEEPEST:
                raise ModelError(f"includes are nested more than {DEEPEST} deep")
            content = self._folders.read(path)
        except (OSError, ValueError) as error:
            reason = error.strerror if isinstance(error, OSError) else str(error)
            raise uri.error(f"'{name[:80]}' cannot be read: {reason}") from None
        except ModelError as error:
            raise uri.error(str(error)) from None
        root = parse(content, shown(Path(path)))
        self._refuse_too_much(uri, root, len(content))
        if root.tag != "sdf":
            raise uri.error(f"the root element of '{name}' is <{root.tag}> instead of <sdf>")
        self.notes |= {note: [name] for note in root.notes}
        minor_of(root)
        check(root, self.notes)
        models = root.children("model")
        if len(models) != 1 or root.children("world"):
            raise uri.error(f"'{name}' holds {len(models)} models; an included file holds one <model>")
        return models[0], (*files, path)

    def _locate(self, name: str, file: str) -> str:
        """Return the path of the file that another one includes.

        Raises:
            ModelError: It is not local, or there is no such package.
        """
        if not name:
            raise ModelError("is empty; name a file or a folder of a model")
        match = _SCHEME.fullmatch(name)
        scheme, rest = (match[1].lower(), match[2]) if match else ("", name)
        if scheme in ("model", "package"):
            package, _, below = rest.strip("/").partition("/")
            try:
                path = os.path.join(self._folders.find(package), below)
            except ModelError as error:
                raise ModelError(str(error).replace("package", scheme, 1)) from None
        elif scheme in ("", "file"):
            path = os.path.normpath(os.path.join(os.path.dirname(file), rest))
        else:
            raise ModelError(f"'{name[:80]}' is not a local file; download it, and write its path")
        return os.path.join(path, self._file_of_model(path)) if os.path.isdir(path) else path

    def _file_of_model(self, folder: str) -> str:
        """Return the name of the SDF file in a folder: the newest that `model.config` states."""
        config = os.path.join(folder, "model.config")
        stated = {0: "model.sdf"}
        if os.path.isfile(config):
            for node in parse(self._folders.read(config), shown(Path(config))).children("sdf"):
                match = _VERSION.fullmatch(str(node.xml.get("version", "1.4")).strip())
                if match and VERSIONS[0] <= int(match[1]) <= VERSIONS[1]:
                    stated[int(match[1])] = node.content()
        return stated[max(stated)]

    def _refuse_too_much(self, uri: Node, root: Node, size: int) -> None:
        self._files, self._size = self._files + 1, self._size + size
        self._count += sum(1 for _ in root.xml.iter("*"))
        if self._files > MOST_FILES or self._count > MOST_ELEMENTS or self._size > LARGEST_FILE:
            raise uri.error(
                f"more than {MOST_FILES} files, {MOST_ELEMENTS} elements or {LARGEST_FILE // 2**20} MiB are "
                "included"
            )


def name_of(own: Node, model: Node) -> str:
    """Return the name of a model, which the element `<include>` may name otherwise."""
    return (word(own, "name") if own.tag == "include" else "") or model.text("name")


def minor_of(node: Node) -> int:
    """Return the minor number of the version of an element's file.

    Raises:
        ModelError: This version is not read.
    """
    root = Node(node.xml.getroottree().getroot(), node.file)
    text = root.text("version")
    match = _VERSION.fullmatch(text)
    if not match or int(match[1]) > VERSIONS[1]:
        raise root.error(f"version '{text[:20]}' of SDFormat is not read; known: 1.4 to 1.12")
    if int(match[1]) < VERSIONS[0]:
        raise root.error(f"version '{text[:20]}' of SDFormat is too old; convert it with `gz sdf -p`")
    return int(match[1])


def _name(own: Node) -> str:
    """Return the name of a model as its world knows it, or the folder of an included one."""
    if own.tag == "model":
        return own.text("name")
    return word(own, "name") or word(own, "uri").rstrip("/").rpartition("/")[2]
