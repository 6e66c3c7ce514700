"""Elements of a xacro file and of its expansion: read with their places, and written one a line."""

from __future__ import annotations

from typing import NamedTuple, NoReturn
from xml.parsers import expat

from ...errors import ModelError
from .xml_node import DOCTYPE, PLACE

#: What XML writes for letters of its own.
_ENTITIES = str.maketrans({"&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;"})


class Tag(NamedTuple):
    """An element; comments and instructions are left out.

    Attributes:
        name: Its name, with its prefix.
        attributes: Its attributes, with their prefixes.
        children: Elements and texts in it.
        place: File ("" for the robot's own) and line.
    """

    name: str
    attributes: dict[str, str]
    children: list[Tag | str]
    place: tuple[str, int]

    def elements(self) -> list[Tag]:
        """Return the elements in it."""
        return [child for child in self.children if isinstance(child, Tag)]


def read_tags(content: bytes, file: str) -> Tag:
    """Return the root element of a file.

    Raises:
        ExpatError: It is not well-formed.
        ModelError: It has a DOCTYPE.
    """
    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.ordered_attributes = False
    inside = [Tag("", {}, [], ("", 0))]

    def start(name: str, attributes: dict[str, str]) -> None:
        made = Tag(name, attributes, [], (file, parser.CurrentLineNumber))
        inside[-1].children.append(made)
        inside.append(made)

    def doctype(*_: object) -> NoReturn:
        raise ModelError(DOCTYPE, line=parser.CurrentLineNumber)

    parser.StartElementHandler, parser.StartDoctypeDeclHandler = start, doctype
    parser.EndElementHandler = lambda _: inside.pop()
    parser.CharacterDataHandler = lambda text: inside[-1].children.append(text)
    parser.Parse(content, True)
    return inside[0].elements()[0]


def written(root: Tag) -> str:
    """Return an element as XML, whose elements have a `PLACE`."""
    out = ['<?xml version="1.0" encoding="utf-8"?>\n']
    _write(root, out)
    return "".join(out)


def _write(tag: Tag, out: list[str]) -> None:
    file, line = tag.place
    attributes = {**tag.attributes, PLACE: f"{file}:{line}"}
    said = "".join(f' {name}="{_escaped(attributes[name])}"' for name in sorted(attributes))
    if [*map(type, tag.children)] in ([], [str]):
        text = "".join(map(str, tag.children))
        out.append(f"<{tag.name}{said}>{_escaped(text)}</{tag.name}>\n" if text else f"<{tag.name}{said}/>\n")
        return
    out.append(f"<{tag.name}{said}>\n")
    for child in tag.children:
        if isinstance(child, Tag):
            _write(child, out)
        elif not child.isspace():
            out.append(f"{_escaped(child)}\n")
    out.append(f"</{tag.name}>\n")


def _escaped(text: str) -> str:
    return text.translate(_ENTITIES)
