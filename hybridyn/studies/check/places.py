"""Where an element of a robot stands: its line, or, of xacro, the line of the macro that writes it."""

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
#: Of one robot.
MOST_FILES = 200


class _Written(NamedTuple):
    """An element with a name as its xacro file writes it."""

    tag: str
    pattern: re.Pattern[str]
    literal: int
    file: str
    line: int | None


class Places:
    """The places of a robot's elements."""

    def __init__(self, root: Node) -> None:
        """Start with nothing looked up.

        Args:
            root: Root element of the robot, xacro expanded.
        """
        self.expanded = root.file.endswith(EXPANDED)
        self.file = root.file.removesuffix(EXPANDED)

    def of(self, tag: str, name: str, line: int | None) -> tuple[str, int | None]:
        """Return file and line of an element.

        Args:
            tag: What it is: "link", "joint", "loop", ...
            name: Its name.
            line: Its line in the text that was read; of no use where xacro wrote that text.

        Returns:
            File and line; for xacro the element whose name, with its ${...} filled in, fits best.
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
        """Every element with a name in the xacro file and the files that it includes by plain paths."""
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
