"""Parse a file for xacro, so that each element of the expansion says where it was written (`PLACE`)."""

from __future__ import annotations

from typing import Any
from xml.dom.expatbuilder import ExpatBuilderNS

from .xml_node import PLACE


class Placing(ExpatBuilderNS):
    """Builds the document of one file; xacro's own elements, which check their attributes, get no place."""

    def __init__(self, file: str) -> None:
        """Prepare for a file, whose name stands in its elements' places."""
        super().__init__()
        self._file = file

    def start_element_handler(self, name: str, attributes: Any) -> None:
        """Begin an element; expat gives its name as "URI name prefix"."""
        if not name.endswith(" xacro"):
            attributes = [*attributes, PLACE, f"{self._file}:{self.getParser().CurrentLineNumber}"]
        super().start_element_handler(name, attributes)


def place_of(error: BaseException) -> tuple[str, int] | None:
    """Return the place of the innermost element that xacro evaluated when it failed, or None."""
    found = None
    frame = error.__traceback__
    while frame is not None:
        node = frame.tb_frame.f_locals.get("node") if frame.tb_frame.f_code.co_name == "eval_all" else None
        if node is not None and node.nodeType == node.ELEMENT_NODE and node.hasAttribute(PLACE):
            file, _, line = node.getAttribute(PLACE).rpartition(":")
            found = file, int(line)
        frame = frame.tb_next
    return found
