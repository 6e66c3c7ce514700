"""Find the file and line of a robot's element; for xacro, those of the macro that writes the element."""

from __future__ import annotations

from functools import cached_property

from ...description.urdf.xml_node import Expanded, Node


class Places:
    """Looks up the places of a robot's elements."""

    def __init__(self, root: Node) -> None:
        """Keep the root element; the others are searched on the first request."""
        self.file, self._root = root.file, root

    def of(self, tag: str, name: str, line: int | None) -> tuple[str, int | None]:
        """Return file and line of an element.

        Args:
            tag: Tag of the element: "link", "joint", "loop", ...
            line: Its line in the text that was read; ignored if xacro wrote that text.
        """
        if not isinstance(self.file, Expanded):
            return self.file, line
        return self._written.get((tag, name), (self.file, None))

    @cached_property
    def _written(self) -> dict[tuple[str, str], tuple[str, int | None]]:
        """Places of all named elements, the first of each name."""
        named = [(node.tag, str(node.xml.get("name")), node) for node in self._root.descendants()]
        return {(tag, name): node.place for tag, name, node in reversed(named)}
