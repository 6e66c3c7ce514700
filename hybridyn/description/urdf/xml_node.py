"""Parse robot files in XML safely, into elements that know their file and line.

A DOCTYPE, which may declare entities, is an error, and so is too much of XML (`bounds`). What is not
well-formed, but what Gazebo, Drake and MuJoCo read alike (`READ_ALIKE`), is read as they do and noted.
Numbers are read strictly: `1,5`, `nan`, `inf`, `1_000` and empty texts are errors. Placements (4, 4) and
axes are read here, too.
"""

from __future__ import annotations

import math
import re
from codecs import BOM_UTF8
from collections.abc import Iterable, Iterator, Sequence
from functools import cache, partial
from typing import Any, NamedTuple, cast

import numpy as np
from lxml import etree

from ...errors import ModelError
from ..bounds import refuse_above
from ..names import closest, did_you_mean, listed
from ..placement import UNTURNED, placement_from, rotation_from_quaternion, rotation_from_rpy
from ..records import Array

#: Largest number accepted; its square is still finite, so no length or inertia overflows later.
LARGEST_NUMBER = 1e150

#: What other readers of robot files accept although XML forbids it, by the kind of libxml2's error.
READ_ALIKE = {
    "ERR_HYPHEN_IN_COMMENT": "'--' in a comment",
    "NS_ERR_UNDEFINED_NAMESPACE": "a prefix without xmlns",
    "NS_ERR_QNAME": "a name that begins with ':'",
    "ERR_RESERVED_XML_NAME": "an XML declaration that is not the first line",
    "ERR_LT_IN_ATTRIBUTE": "'<' in an attribute",
}
#: The only prefix with a meaning.
LOST_PREFIX = "drake"
#: The declaration at the start of a file. Other readers ignore what it says.
_DECLARATION = re.compile(rb"\s*<\?xml\b[^<>]*\?>")

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_INFINITE = re.compile(r"[+-]?inf(inity)?", re.ASCII | re.IGNORECASE)


DOCTYPE = "<!DOCTYPE is not allowed in a robot file; remove it"

#: Attribute of an element that xacro writes: file ("" for the file itself) and line of its origin.
PLACE = "hybridyn-place"


class Expanded(str):
    """The path of a xacro file, with the file and line where the elements of its expansion were written.

    Attributes:
        places: `FILE:LINE` (":LINE" in the file itself) by line of the expansion; each element has its own.
    """

    __slots__ = ("places",)
    places: dict[Any, Any]


def parse(text: bytes, file: str, *, placed: bool = False) -> XmlNode:
    """Parse the text of an XML file into its root element.

    Args:
        placed: Whether the text is the expansion of a xacro file, whose elements have a `PLACE`.

    Raises:
        ModelError: The text is not well-formed XML, is too large, or has a DOCTYPE.
    """
    in_file = partial(ModelError, file=file)
    refuse_above("XML", len(text), in_file)
    parser = etree.XMLParser(
        resolve_entities=False,
        no_network=True,
        load_dtd=False,
        huge_tree=False,
        remove_comments=True,
        remove_pis=True,
        recover=True,
    )
    root, notes = _recovered(text, parser, file)
    if root.getroottree().docinfo.internalDTD is not None:
        raise ModelError(DOCTYPE, file=file, line=1)
    refuse_above("elements", cast("float", root.xpath("count(//*)")), in_file)
    if placed:
        file = Expanded(file)
        file.places = {xml.sourceline: xml.get(PLACE, "") for xml in root.iter("*")}
        etree.strip_attributes(root, PLACE)
    return XmlNode(root, file, tuple(notes))


def _recovered(text: bytes, parser: etree.XMLParser, file: str) -> tuple[etree._Element, list[str]]:
    """Return the root element of a text, and notes on what is not XML and is read all the same.

    Raises:
        ModelError: Something else is not XML.
    """
    root, errors = _tree(text, parser, file)
    declared, odd = _DECLARATION.match(text.removeprefix(BOM_UTF8)), ""
    if declared and any(entry.type_name not in READ_ALIKE for entry in errors):
        odd = declared[0].decode("ascii", "replace").strip()[:80]
        blank = re.sub(rb"[^\r\n]", b" ", declared[0])
        text = blank + text.removeprefix(BOM_UTF8)[declared.end() :]
        root, errors = _tree(text, parser, file)
    if wrong := next((entry for entry in errors if entry.type_name not in READ_ALIKE), None):
        message = f"not well-formed XML: {wrong.message.strip()}, column {wrong.column}"
        raise ModelError(message, file=file, line=wrong.line)
    # After the first error, libxml2 leaves out what follows the root without a word.
    roots = "count(*|text()[normalize-space()])"
    whole = b"<all>%b</all>" % text.removeprefix(BOM_UTF8)
    if errors and etree.fromstring(whole, parser).xpath(roots) != 1:
        raise ModelError("not well-formed XML: something follows the root element", file=file)
    first = {entry.type_name: entry.line for entry in reversed(errors)}
    notes = [
        f"{file}:{first[kind]}: {what} is not XML; it is read as Gazebo, Drake and MuJoCo do"
        for kind, what in READ_ALIKE.items()
        if kind in first
    ]
    if odd:
        notes.append(
            f"{file}:1: the declaration {odd} is not XML; it is ignored, as Gazebo, Drake and MuJoCo do"
        )
    return root, notes


def _tree(text: bytes, parser: etree.XMLParser, file: str) -> tuple[etree._Element, list[Any]]:
    """Return the root element of a text, and the errors that the parser recovered from."""
    try:
        root = etree.fromstring(text, parser)
    except (ValueError, LookupError, etree.XMLSyntaxError) as error:
        raise ModelError(f"not readable as XML: {error.args[0]}", file=file) from None
    return root, [entry for entry in parser.error_log if entry.level >= etree.ErrorLevels.ERROR]


def _written(xml: etree._Element) -> str:
    """Return the name of an element with its prefix; its tag has the namespace instead, or ':' alone."""
    tag = str(xml.tag)
    if tag[0] != "{":
        return f"{LOST_PREFIX}{tag}" if tag[0] == ":" else tag
    name = tag.rpartition("}")[2]
    return f"{xml.prefix}:{name}" if xml.prefix else name


@cache
def _patterns(tags: tuple[str, ...]) -> tuple[str, ...]:
    """Return what matches elements with one of these names, in any namespace; every element for no name."""
    bare = {tag: tag.rpartition(":")[2] for tag in tags}
    return tuple(f"{{*}}{name}" for tag in tags for name in {tag, bare[tag], f":{bare[tag]}"}) or ("*",)


class XmlNode:
    """An element of an XML file, with strict readers of attributes; every error names file and line.

    Attributes:
        xml: The lxml element. Attributes and children are looked at once: they must not change afterwards.
        file: Path of the file, for messages.
        notes: Of a root element: what is not well-formed in the file.
        tag: Name of the element as the author wrote it, prefix included.
        attrib: Its attributes.
    """

    __slots__ = ("_inner", "attrib", "file", "notes", "tag", "xml")

    def __init__(self, xml: etree._Element, file: str, notes: tuple[str, ...] = ()) -> None:
        self.xml, self.file, self.notes, self.tag = xml, file, notes, _written(xml)
        self.attrib = cast("dict[str, str]", dict(xml.items()))
        self._inner: list[XmlNode] | None = None if len(xml) else []

    @property
    def place(self) -> tuple[str, int | None]:
        """File and line of the element, from 1; those of its macro if xacro wrote it."""
        line = cast("int | None", self.xml.sourceline)
        if not isinstance(self.file, Expanded):
            return self.file, line
        file, _, number = str(self.file.places.get(line, "")).rpartition(":")
        return file or str(self.file), int(number or 0) or None

    @property
    def line(self) -> int | None:
        """Line of the element in `file`, from 1; None if xacro wrote it from another file."""
        file, line = self.place
        return line if file == self.file else None

    @property
    def where(self) -> str:
        """Place of the element in words: its line, and the file if that is not `file`."""
        file, line = self.place
        return f"{file}:{line}" if file != self.file else f"line {line}" if line else file

    @property
    def at(self) -> str:
        """Place of the element as notes begin with it: `robot.urdf:12`."""
        file, line = self.place
        return f"{file}:{line}" if line else file

    @property
    def label(self) -> str:
        """The element as it is named in messages: `<joint name="elbow">`."""
        name = self.attrib.get("name", "")[:100]
        return f'<{self.tag} name="{name}">' if name else f"<{self.tag}>"

    def error(self, message: str) -> ModelError:
        """Return (do not raise) an error with this element's file, line and name."""
        file, line = self.place
        return ModelError(
            f"{self.label}: {message}", file=file, line=line, element=self.attrib.get("name") or self.tag
        )

    def children(self, *tags: str) -> list[XmlNode]:
        """Return the child elements in file order: all of them, or those with one of the tags."""
        if self._inner is None:
            self._inner = [XmlNode(xml, self.file) for xml in self.xml]
        return [node for node in self._inner if node.tag in tags] if tags else self._inner.copy()

    def descendants(self, *tags: str) -> Iterator[XmlNode]:
        """Yield the elements below this one in file order: all of them, or those with one of the tags."""
        for xml in self.xml.iterdescendants(*_patterns(tags)):
            if not tags or _written(xml) in tags:
                yield XmlNode(xml, self.file)

    def child(self, *tags: str) -> XmlNode | None:
        """Return the only child with one of these tags, or None; raise ModelError if there are two."""
        found = self.children(*tags)
        if len(found) > 1:
            raise found[1].error(f"stated twice in {self.label}; keep one")
        return found[0] if found else None

    def required_child(self, tag: str) -> XmlNode:
        """Return the only child with this tag; raise ModelError if there is none, or two."""
        found = self.child(tag)
        if found is None:
            written = [node.tag for node in self.children()]
            raise self.error(f"<{tag}> is missing{did_you_mean(tag, written)}")
        return found

    def text(self, attribute: str) -> str:
        """Return an attribute without surrounding blanks; raise ModelError if it is missing or empty."""
        value = self.attrib.get(attribute, "").strip()
        if not value:
            wrong = "is empty" if attribute in self.attrib else "is missing"
            raise self.error(f"attribute '{attribute}' {wrong}{did_you_mean(attribute, self.attributes())}")
        return value

    def attributes(self) -> list[str]:
        """Return the names of the attributes, except those with a namespace or a prefix."""
        return [name for name in self.attrib if not name.startswith("{") and ":" not in name]

    def number(self, attribute: str = "", default: float | None = None, *, infinite: bool = False) -> float:
        """Return an attribute, or the element's text, as a number.

        Args:
            attribute: Its name; "" for the text (`<mechanicalReduction>50</mechanicalReduction>`).
            default: The number where the attribute is absent.
            infinite: Whether `inf` and `-inf` are numbers (of limits only).
        """
        if default is not None and attribute not in self.attrib:
            return default
        stated = self.text(attribute) if attribute else self.content()
        return self._number(stated, attribute or "text", infinite)

    def numbers(self, attribute: str, count: int, default: Iterable[float] | None = None) -> Array:
        """Return an attribute, or the text for "", as `count` numbers separated by blanks, shape (count,)."""
        if default is not None and attribute not in self.attrib:
            return np.array(list(default), dtype=float)
        words = (self.text(attribute) if attribute else self.content()).split()
        if len(words) != count:
            what = f"attribute '{attribute}'" if attribute else "text"
            raise self.error(f"{what} has {len(words)} numbers instead of {count}")
        return np.array([self._number(word, attribute or "text", False) for word in words])

    def content(self) -> str:
        """Return the element's text in one line, without surrounding blanks."""
        return " ".join(str(self.xml.text or "").split())

    def flag(self, attribute: str, default: bool) -> bool:
        """Return an attribute as true or false."""
        word = self.attrib.get(attribute, str(default)).strip().lower()
        if word not in ("true", "false", "1", "0"):
            raise self.error(f"attribute '{attribute}' is '{word}' instead of true or false")
        return word in ("true", "1")

    def only(self, attributes: Iterable[str], children: Iterable[str]) -> None:
        """Raise for every attribute and child that is not among the given names, so that none is ignored."""
        known_attributes, known_children = list(attributes), list(children)
        for name in self.attrib:
            if name not in known_attributes:
                hint = did_you_mean(name, known_attributes)
                raise self.error(f"unknown attribute '{name}'{hint}; known: {listed(known_attributes)}")
        for node in self.children():
            if node.tag not in known_children:
                hint = did_you_mean(node.tag, known_children)
                raise node.error(
                    f"unknown in {self.label}{hint}; known: {listed(known_children) or 'nothing'}"
                )

    def refuse_misspelt(self, attributes: Sequence[str], children: Sequence[str]) -> None:
        """Raise for attributes and children that resemble an absent one of the given names; ignore others."""
        if [name for name in self.attrib if name not in attributes]:
            written = dict.fromkeys(self.attributes())
            for name in written:
                if name not in attributes and (
                    best := closest(name, [x for x in attributes if x not in written])
                ):
                    raise self.error(f"unknown attribute '{name}'; did you mean '{best}'?")
        strange = {node.tag: node for node in self.children() if node.tag not in children}
        for tag, node in strange.items():
            if best := closest(tag, [x for x in children if not self.children(x)]):
                raise node.error(f"unknown in {self.label}; did you mean <{best}>?")

    def _number(self, word: str, what: str, infinite: bool) -> float:
        if _NUMBER.fullmatch(word):
            if abs(value := float(word)) <= LARGEST_NUMBER:
                return value
            raise self.error(f"{what} '{word[:40]}' is too large (limit {LARGEST_NUMBER:g})")
        if infinite and _INFINITE.fullmatch(word):
            return -math.inf if word.startswith("-") else math.inf
        raise self.error(f"{what} '{word[:40]}' is not a finite number")


class OfAttributes(NamedTuple):
    """An element that states numbers by its attributes, as `rows.Stating`."""

    node: XmlNode

    def stated(self, name: str, infinite: bool) -> float | None:
        """Return the number of an attribute, None if it is absent."""
        return self.node.number(name, infinite=infinite) if name in self.node.attrib else None

    def error(self, message: str) -> ModelError:
        """Return (not raise) an error that names the element."""
        return self.node.error(message)


class OfChildren(NamedTuple):
    """An element that states numbers by the texts of its children, as `rows.Stating`."""

    node: XmlNode

    def stated(self, name: str, infinite: bool) -> float | None:
        """Return the number in a child, None if it is absent or empty."""
        child = self.node.child(name)
        return child.number(infinite=infinite) if child is not None and child.content() else None

    def error(self, message: str) -> ModelError:
        """Return (not raise) an error that names the element."""
        return self.node.error(message)


#: Shortest axis or quaternion with a direction; files write unit vectors with rounding, zero is a mistake.
SMALLEST_AXIS = 1e-12


def origin_of(node: XmlNode | None) -> Array:
    """Return the placement that an element states, shape (4, 4); the identity for None.

    The attributes are `xyz` [m] and either `rpy` [rad] or `quat_xyzw` (URDF 1.1).

    Raises:
        ModelError: A number does not parse, the quaternion is zero, or both orientations are given.
    """
    if node is None:
        return np.eye(4)
    position = node.numbers("xyz", 3, (0, 0, 0))
    if "quat_xyzw" not in node.attrib:
        turn = rotation_from_rpy(*node.numbers("rpy", 3)) if "rpy" in node.attrib else UNTURNED
        return placement_from(turn, position)
    if "rpy" in node.attrib:
        raise node.error("states both 'rpy' and 'quat_xyzw'; keep one")
    quaternion = node.numbers("quat_xyzw", 4)
    norm = float(np.linalg.norm(quaternion))
    if norm < SMALLEST_AXIS:
        raise node.error("quat_xyzw is zero; a unit quaternion is needed")
    return placement_from(rotation_from_quaternion(*(quaternion / norm)), position)


def axis_of(node: XmlNode | None) -> Array:
    """Return the unit vector that an `<axis xyz>` element states, shape (3,); x for None.

    Raises:
        ModelError: A number does not parse, or the axis is zero.
    """
    if node is None:
        return np.array([1.0, 0.0, 0.0])
    return unit(node, node.numbers("xyz", 3), 'xyz="0 0 1"')


def unit(node: XmlNode, axis: Array, example: str) -> Array:
    """Return the unit vector along an axis that an element states, shape (3,).

    Args:
        node: The element.
        axis: The axis, shape (3,).
        example: How the element states one, for the message.

    Raises:
        ModelError: The axis is zero.
    """
    norm = float(np.linalg.norm(axis))
    if norm < SMALLEST_AXIS:
        raise node.error(f"the axis is zero; give a direction such as {example}")
    out: Array = axis / norm
    return out
