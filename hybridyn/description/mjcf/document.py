"""Merge an MJCF file with the files that it includes, and open the models that it attaches.

hybridyn opens these files, not MuJoCo: only in the robot's folders, and with the limits of all robot files.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple
from xml.sax.saxutils import quoteattr

from lxml import etree

from ...errors import ModelError
from ..shipped import shown
from ..urdf.robot_folders import RobotFolders
from ..urdf.xml_node import LARGEST_FILE, MOST_ELEMENTS, Node, parse

#: Most files that one robot may include.
MOST_FILES = 1000

#: Folders whose neighbours belong to the robot, too: `robot/mjcf/robot.xml` reads `robot/meshes/`.
FILE_FOLDERS = ("mjcf", "xml", "mujoco")

#: Attribute that marks the first elements of an included file: its number in `Document.files`.
FILE = "{hybridyn}file"

#: Root elements of an included file.
INCLUDED_ROOTS = ("mujoco", "mujocoinclude")


class Place(NamedTuple):
    """The place of an element.

    Attributes:
        line: Its line, from 1, or None.
    """

    file: str
    line: int | None


class Document:
    """An MJCF file merged with its includes.

    Attributes:
        root: Root element; included elements replace their `<include>`.
        folders: The folders that it may read.
        files: Paths of the files, the robot's own first.
        notes: What is not well-formed in included files, and what is read past.
        models: The files of `<model>`, by the name that the tree now has for each.
    """

    def __init__(self, root: Node, package_dirs: list[str], within: Document | None = None) -> None:
        """Merge all included files, and open all attached ones.

        Args:
            root: Root element; it is changed.
            package_dirs: Folders that the user allows.
            within: The file that attaches this one: its folders and limits hold for both.

        Raises:
            ModelError: A file cannot be read, or is named twice.
        """
        self.root = root
        main = os.path.abspath(root.file)
        around = Path(main).parent
        granted = [str(around.parent)] if around.name in FILE_FOLDERS else []
        own = RobotFolders(main, package_dirs, [], LARGEST_FILE, granted)
        self.folders: RobotFolders = within.folders if within else own
        self.files, self.notes = [root.file], [*root.notes] if within else list[str]()
        self._paths = [main]
        self._seen: set[str] = within._seen if within else {os.path.realpath(main)}
        self._spent: Counter[str] = within._spent if within else Counter()
        waiting = [(xml, 0) for xml in root.xml.iter("include")]
        while waiting:
            xml, number = waiting.pop(0)
            waiting += self._include(Node(xml, self.files[number]), number)
        self.models: dict[str, Document] = {}
        for node in list(self.nodes()):
            if node.tag == "model" and "file" in node.xml.attrib:
                content, path = self._opened(node, node.text("file"), self.files.index(node.file))
                key = f"model{len(self._seen)}.xml"  # unlike those of the other files
                node.xml.set("file", key)
                self.models[key] = Document(parse(content, shown(Path(path))), package_dirs, self)

    def every(self) -> list[Document]:
        """Return this file and all that it attaches."""
        return [self, *(inner for model in self.models.values() for inner in model.every())]

    def nodes(self) -> Iterator[Node]:
        """Yield every element, a parent before its children, each with its own file."""
        waiting = [(self.root.xml, 0)]
        while waiting:
            xml, above = waiting.pop()
            number = int(xml.get(FILE, above))
            yield Node(xml, self.files[number])
            waiting += [(child, number) for child in reversed(xml)]

    def beside(self, *parts: str) -> str:
        """Return a path that is relative to the robot's own file.

        Args:
            parts: Parts of the path; an absolute part makes it absolute.
        """
        return os.path.join(os.path.dirname(self._paths[0]), *parts)

    def text(self) -> tuple[str, list[Place]]:
        """Write the tree, one element's start or end a line; return the text, and the element of each line.

        Raises:
            ModelError: An attribute has a namespace, which MJCF does not know.
        """
        lines: list[str] = []
        places: list[Place] = []
        waiting: list[tuple[etree._Element, int, bool]] = [(self.root.xml, 0, False)]
        while waiting:
            xml, above, ends = waiting.pop()
            number = int(xml.get(FILE, above))
            node = Node(xml, self.files[number])
            lines.append(f"</{node.tag}>" if ends else _start(node))
            places.append(Place(*node.place))
            if not ends and len(xml):
                waiting.append((xml, above, True))
                waiting += [(child, number, False) for child in reversed(xml)]
        return "\n".join(lines), places

    def _include(self, node: Node, number: int) -> list[tuple[etree._Element, int]]:
        """Put the elements of a file in place of `<include>`, and return the includes among them."""
        node.xml.attrib.pop(FILE, "")  # its number is known
        node.only(["file"], [])
        name = node.text("file")
        content, path = self._opened(node, name, number)
        inner = parse(content, shown(Path(path)))
        if inner.tag not in INCLUDED_ROOTS:
            raise node.error(f"the root element of '{name}' is <{inner.tag}> instead of <mujocoinclude>")
        self._spent["elements"] += sum(1 for _ in inner.xml.iter("*"))
        if self._spent["elements"] > MOST_ELEMENTS:
            raise node.error(f"the included files have more than {MOST_ELEMENTS} elements")
        self.files.append(inner.file)
        self.notes += inner.notes
        self._paths.append(path)
        here = len(self.files) - 1
        includes = [(xml, here) for xml in inner.xml.iter("include")]
        parent = node.xml.getparent()
        if parent is None:
            raise node.error("cannot be the root element")
        at = parent.index(node.xml)
        children = list(inner.xml)
        for child in children:
            child.set(FILE, str(here))
        parent[at : at + 1] = children
        return includes

    def _opened(self, node: Node, name: str, number: int) -> tuple[bytes, str]:
        """Read a file that an element of file `number` names; refuse too many, and one that was read."""
        content, path = self._read(node, name, number)
        self._refuse_too_much(node, name, content, path)
        return content, path

    def _read(self, node: Node, name: str, number: int) -> tuple[bytes, str]:
        """Read a file: its path starts at the robot's file, else at the file that names it."""
        wrong: OSError | ValueError | None = None
        for start in dict.fromkeys((self._paths[0], self._paths[number])):
            path = os.path.normpath(os.path.join(os.path.dirname(start), name))
            try:
                return self.folders.read(path), path
            except ModelError as error:
                raise node.error(str(error)) from None
            except (OSError, ValueError) as error:
                wrong = wrong or error
        reason = wrong.strerror if isinstance(wrong, OSError) else str(wrong)
        raise node.error(f"file '{name}' cannot be read: {reason}")

    def _refuse_too_much(self, node: Node, name: str, content: bytes, path: str) -> None:
        real = os.path.realpath(path)
        if real in self._seen:
            raise node.error(f"file '{name}' is included twice; MuJoCo includes a file once")
        self._seen.add(real)
        self._spent["bytes"] += len(content)
        if len(self._seen) > MOST_FILES or self._spent["bytes"] > LARGEST_FILE:
            raise node.error(f"more than {MOST_FILES} files or {LARGEST_FILE // 2**20} MiB are included")


def _start(node: Node) -> str:
    """Write the start of an element, closed where it has no children."""
    written = [node.tag]
    for name, value in ((str(key), str(value)) for key, value in node.xml.attrib.items()):
        if name == FILE:
            continue
        if name.startswith("{"):
            raise node.error(f"attribute '{name}' has a namespace, which MJCF does not know")
        written.append(f"{name}={quoteattr(value)}")
    return f"<{' '.join(written)}{'' if len(node.xml) else '/'}>"
