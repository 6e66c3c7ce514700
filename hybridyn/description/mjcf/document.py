"""Merge an MJCF file with the files that it includes, and open the models that it attaches.

hybridyn opens these files, not MuJoCo: only in the robot's folders, and with the limits of all robot files.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import cast

from lxml import etree

from ...errors import ModelError
from ..shipped import shown
from ..urdf.robot_folders import RobotFolders
from ..urdf.xml_node import LARGEST_FILE, MOST_ELEMENTS, Node, parse

#: Most files that one robot may include.
MOST_FILES = 1000

#: Folders whose neighbours belong to the robot, too: `robot/mjcf/robot.xml` reads `robot/meshes/`.
FILE_FOLDERS = ("mjcf", "xml", "mujoco")

#: Attribute that marks the elements of an included file: its number in `Document.files`.
FILE = "{hybridyn}file"

#: Root elements of an included file.
INCLUDED_ROOTS = ("mujoco", "mujocoinclude")


#: File and line of an element, as in `Node.place`.
Place = tuple[str, int | None]


class Document:
    """An MJCF file merged with its includes.

    Attributes:
        root: Root element; included elements replace their `<include>`.
        key: Name of the file in the tree that attaches it, "" of the robot's own.
        files: Paths of the files, the robot's own first.
        notes: What is not well-formed in included files, and what is read past.
        models: The files of `<model>`.
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
        main = os.path.abspath(root.file)
        around = Path(main).parent
        granted = [str(around.parent)] if around.name in FILE_FOLDERS else []
        folders = RobotFolders(main, package_dirs, [], LARGEST_FILE, granted)
        self.root, self.key, self.files, self._paths = root, "", [root.file], [main]
        self.notes = [*root.notes] if within else list[str]()
        self._folders: RobotFolders = within._folders if within else folders
        self._seen: set[str] = within._seen if within else {os.path.realpath(main)}
        self._spent: Counter[str] = within._spent if within else Counter()
        waiting = [*root.xml.iter("include")]
        while waiting:
            waiting += self._include(waiting.pop(0))
        self.models: list[Document] = []
        for node in self.nodes("//model[@file]"):
            inner, _ = self._opened(node, self.files.index(node.file))
            self.models.append(Document(inner, package_dirs, self))
            self.models[-1].key = f"model{len(self._seen)}.xml"  # unlike those of the other files
            node.xml.set("file", self.models[-1].key)

    def every(self) -> list[Document]:
        """Return this file and all that it attaches."""
        return [self, *(inner for model in self.models for inner in model.every())]

    def nodes(self, path: str = "//*") -> list[Node]:
        """Return the elements of an XPath, by default all, a parent before its children, with their files."""
        found = cast("list[etree._Element]", self.root.xml.getroottree().xpath(path))
        return [Node(xml, self.files[int(xml.get(FILE, 0))]) for xml in found]

    def beside(self, *parts: str) -> str:
        """Return a path that is relative to the robot's own file.

        Args:
            parts: Parts of the path; an absolute part makes it absolute.
        """
        return os.path.join(os.path.dirname(self._paths[0]), *parts)

    def read(self, node: Node, folders: Iterable[str], mend: str = "") -> tuple[bytes, str]:
        """Read the file that an element names, and return its path, too.

        Args:
            node: The element; its attribute is `file`.
            folders: Where the path may start; the first one in which a file can be opened counts.
            mend: What follows in an error.

        Raises:
            ModelError: It cannot be read, or is outside the robot's folders.
        """
        name, wrong = node.text("file"), ""
        for folder in dict.fromkeys(folders):
            path = os.path.normpath(os.path.join(folder, name))
            try:
                return self._folders.read(path), path
            except ModelError as error:
                raise node.error(f"{error}{mend}") from None
            except (OSError, ValueError) as error:
                wrong = wrong or str(getattr(error, "strerror", None) or error)
        what = "mesh" if node.tag == "mesh" else "file"
        raise node.error(f"{what} '{name}' cannot be read: {wrong}{mend}")

    def text(self) -> tuple[str, list[Place]]:
        """Write the tree, one start or end of an element a line; return also the place of each line."""
        places: list[Place] = []
        for event, xml in etree.iterwalk(self.root.xml, events=("start", "end")):
            xml.text, xml.tail = "\n" if len(xml) else None, "\n"
            if event == "start" or len(xml):
                places.append(Node(xml, self.files[int(xml.get(FILE, 0))]).place)
        etree.strip_attributes(self.root.xml, FILE)
        etree.cleanup_namespaces(self.root.xml)
        return etree.tostring(self.root.xml, encoding="unicode"), places

    def _include(self, xml: etree._Element) -> list[etree._Element]:
        """Put the elements of a file in place of `<include>`, and return the includes among them."""
        number = int(xml.attrib.pop(FILE, "0"))
        node, parent = Node(xml, self.files[number]), xml.getparent()
        node.only(["file"], [])
        inner, path = self._opened(node, number)
        if inner.tag not in INCLUDED_ROOTS or parent is None:
            name = node.text("file")
            raise node.error(f"the root element of '{name}' is <{inner.tag}> instead of <mujocoinclude>")
        self.files.append(inner.file)
        self._paths.append(path)
        self.notes += inner.notes
        for one in inner.xml.iter("*"):
            one.set(FILE, str(len(self.files) - 1))
        includes, at = [*inner.xml.iter("include")], parent.index(xml)
        parent[at : at + 1] = [*inner.xml]
        return includes

    def _opened(self, node: Node, number: int) -> tuple[Node, str]:
        """Return the root of a file that an element of file `number` names, and the file's path.

        Its path starts at the robot's file, else at the file that names it.
        """
        content, path = self.read(node, (os.path.dirname(self._paths[start]) for start in (0, number)))
        real = os.path.realpath(path)
        if real in self._seen:
            name = node.text("file")
            raise node.error(f"file '{name}' is included twice; MuJoCo includes a file once")
        inner = parse(content, shown(Path(path)))
        self._seen.add(real)
        most = {"files": MOST_FILES, "bytes": LARGEST_FILE, "elements": MOST_ELEMENTS}
        self._spent.update({"files": 1, "bytes": len(content), "elements": len([*inner.xml.iter("*")])})
        for what in (what for what, limit in most.items() if self._spent[what] > limit):
            raise node.error(f"more than {most[what]:,} {what} are included")
        return inner, path
