"""Find the file and line of a robot's element; for xacro, those of the macro that writes the element."""

from __future__ import annotations

import re
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

from lxml import etree

from ...description.shipped import shown
from ...description.urdf.xml_node import Node

EXPANDED = " (expanded)"
SUBSTITUTED = re.compile(r"\$\{[^}]*\}|\$\([^)]*\)")
#: Largest number of xacro files of one robot that are searched.
MOST_FILES = 200


class _Written(NamedTuple):
    """A named element of a xacro file, with its name as a pattern."""

    tag: str
    pattern: re.Pattern[str]
    literal: int
    file: str
    line: int | None


class Places:
    """Looks up the places of a robot's elements."""

    def __init__(self, root: Node) -> None:
        """Keep the file name; xacro files are searched on the first request."""
        self.expanded = root.file.endswith(EXPANDED)
        self.file = root.file.removesuffix(EXPANDED)

    def of(self, tag: str, name: str, line: int | None) -> tuple[str, int | None]:
        """Return file and line of an element.

        Args:
            tag: Tag of the element: "link", "joint", "loop", ...
            line: Its line in the text that was read; ignored if xacro wrote that text.

        Returns:
            File and line. For xacro, those of the element whose name pattern, with any text in place of
            ${...}, fits the name best.
        """
        if not self.expanded:
            return self.file, line
        fitting = [w for w in self._written if w.tag == tag and w.pattern.fullmatch(name)]
        if not fitting:
            return self.file, None
        best = max(fitting, key=lambda written: written.literal)
        return best.file, best.line

    @cached_property
    def _written(self) -> list[_Written]:
        """All named elements of the xacro file and of the files that it includes by plain paths."""
        out: list[_Written] = []
        waiting, seen = [Path(self.file)], set[Path]()
        parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, recover=True)
        while waiting and len(seen) < MOST_FILES:
            file = waiting.pop()
            if file.resolve() in seen or not file.is_file():
                continue
            seen.add(file.resolve())
            root = etree.fromstring(file.read_bytes(), parser)
            for xml in root.iter("*") if root is not None else ():
                tag, name = str(xml.tag).rpartition("}")[2], xml.get("name")
                if tag == "include" and (inner := xml.get("filename")) and "$" not in inner:
                    waiting.append(file.parent / inner)
                elif name and not str(xml.tag).startswith("{"):
                    parts = SUBSTITUTED.split(name)
                    pattern = re.compile(".*".join(map(re.escape, parts)), re.DOTALL)
                    out.append(_Written(tag, pattern, sum(map(len, parts)), shown(file), Node(xml, "").line))
        return out
