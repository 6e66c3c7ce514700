"""Draw valid files from the grammar of a format, and take parts out of them again.

A grammar is a text with one rule a line, `element: part part ...`; lines with a blank before them go on.
A part is an attribute `name=type` or a child. `?` behind it means that it may be missing, `*` that it may
stand up to twice. `="type"` without a name is the text of the element. A rule for `inertial/pose` is that of
a `<pose>` in an `<inertial>`.

Types: `n` a number, `+` one above zero, `3` (or another count) several numbers, `+3` several above zero,
`u4` a unit vector; `id` a new name; `$joint` the name of an element `<joint>` that the file has, and
`$joint:revolute|prismatic` of one of these types. Other words stand for themselves, with a comma for a blank,
and `a|b` is one of them. No number is a usual default, so that each one counts; those above zero are the
moments of a body in any order.
"""

from __future__ import annotations

import random
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import NamedTuple


@dataclass
class Element:
    """An element of a file, in XML or in USD.

    Attributes:
        tag: Its name.
        attributes: Its attributes by name.
        children: The elements in it.
        text: Its text.
    """

    tag: str
    attributes: dict[str, str] = field(default_factory=dict)
    children: list[Element] = field(default_factory=list)
    text: str = ""

    def below(self) -> Iterator[Element]:
        """Yield this element and all below it."""
        yield self
        for child in self.children:
            yield from child.below()

    def xml(self) -> str:
        """Return the element as XML, one start or end of an element a line."""
        words = "".join(f' {name}="{value}"' for name, value in self.attributes.items())
        inside = "".join(f"\n{child.xml()}" for child in self.children)
        if not (inside or self.text):
            return f"<{self.tag}{words}/>"
        return f"<{self.tag}{words}>{self.text}{inside}</{self.tag}>"


def el(tag: str, *children: Element, text: str = "", **attributes: str) -> Element:
    """Return an element; a trailing underscore of an attribute's name is left out."""
    named = {name.rstrip("_"): value for name, value in attributes.items()}
    return Element(tag, named, [*children], text)


class Part(NamedTuple):
    """A part of a rule: an attribute with its type, or a child, and how often it stands: "", "?" or "*"."""

    name: str
    kind: str
    often: str


class Grammar:
    """The rules of a format, with which elements are filled."""

    def __init__(self, text: str) -> None:
        """Read rules."""
        self.rules: dict[str, list[Part]] = {}
        for line in re.sub(r"\n +", " ", text.strip()).splitlines():
            if line and not line.startswith("#"):
                place, _, parts = line.partition(": ")
                self.rules[place] = [_part(word) for word in parts.split()]

    def fill(self, element: Element, within: Element, draw: random.Random, often: float = 0.4) -> Element:
        """Add parts that the rule of an element has and the element has not, and fill its children.

        Args:
            element: The element; it is changed.
            within: The root of the file, for names.
            draw: Source of chance.
            often: How likely a part stands that may be missing.
        """
        self._fill(element, Element(""), within, draw, often)
        return element

    def _fill(
        self, element: Element, above: Element, root: Element, draw: random.Random, often: float
    ) -> bool:
        """Fill an element; return whether it has all that it needs: a joint to name, say."""
        stated = {*element.attributes, *(one.tag for one in element.children)}
        needed = set[str]()
        place = f"{above.tag}/{element.tag}"
        for name, kind, mark in self.rules.get(place, self.rules.get(element.tag, [])):
            if name in stated or (not name and element.text):
                continue
            count = sum(draw.random() < often for _ in range(1 + (mark == "*"))) if mark else 1
            for _ in range(count):
                if not kind:
                    needed |= {name} if not mark else set()
                    element.children.append(Element(name))
                elif not (value := _value(kind, root, draw, (above, *above.children, element))):
                    if not mark:
                        return False
                elif name:
                    element.attributes[name] = value
                else:
                    element.text = value
        whole = [one for one in element.children if self._fill(one, element, root, draw, often)]
        element.children = whole
        return needed <= {one.tag for one in whole}


def _part(word: str) -> Part:
    often = word[-1] if word[-1] in "?*" else ""
    name, sign, kind = word.removesuffix(often).partition("=")
    return Part(name, kind if sign else "", often)


def _value(kind: str, root: Element, draw: random.Random, around: Sequence[Element] = ()) -> str:
    """Return a value of a type, "" where the file has no element with such a name.

    A name is none that the element, its neighbours or the one around it have: a joint follows another one.
    """
    if kind.startswith("$"):
        tag, _, types = kind[1:].partition(":")
        found = [one.attributes for one in root.below() if one.tag == tag and "name" in one.attributes]
        names = {one["name"] for one in found if not types or one.get("type", "") in types.split("|")}
        near = {
            value for one in around if one.tag != tag or one is around[0] for value in one.attributes.values()
        }
        return draw.choice(sorted(names - near - {"world"}) or [""])
    if kind == "id":
        return f"new{draw.randrange(10**6)}"
    if found := re.fullmatch(r"(n|\+|u)?(\d*)", kind):
        values = [draw.uniform(0.5, 0.9) for _ in range(int(found[2] or 1))]
        if found[1] == "u":
            size = sum(value**2 for value in values) ** 0.5
            return " ".join(f"{value / size:.15g}" for value in values)
        signs = [1 if found[1] == "+" else draw.choice((-1, 1)) for _ in values]
        return " ".join(f"{sign * value:.3f}" for sign, value in zip(signs, values, strict=True))
    return draw.choice(kind.split("|")).replace(",", " ")


class Place(NamedTuple):
    """A part of a file: an attribute, or an element with all in it.

    Attributes:
        owner: The element that has it.
        part: Name of the attribute, or the element.
        about: Name of the element, of the owner, or of the nearest one around that has a name.
    """

    owner: Element
    part: str | Element
    about: str

    @property
    def name(self) -> str:
        """`joint[fixed]/limit` for an element in one of this type, `joint@name` for an attribute."""
        mark, part = ("/", self.part.tag) if isinstance(self.part, Element) else ("@", self.part)
        kind = f"[{self.owner.attributes['type']}]" if "type" in self.owner.attributes else ""
        return f"{self.owner.tag}{kind}{mark}{part}"


def places(root: Element, harmless: Callable[[str], object], about: str = "") -> Iterator[Place]:
    """Yield the parts of a file that say something, but for names, which other parts need.

    Args:
        root: The file, or an element of it.
        harmless: Tells of a part by its name whether it says nothing; no part of it is given, either.
        about: Name of the nearest element around the root.
    """
    about = root.attributes.get("name", about)
    for part in (*root.attributes, *root.children):
        inner = part if isinstance(part, Element) else Element("", {"": ""})
        place = Place(root, part, inner.attributes.get("name", about))
        empty = not (inner.attributes or inner.children or inner.text)
        if part != "name" and not empty and not harmless(place.name):
            yield place
            yield from places(inner, harmless, about) if inner is part else ()


@contextmanager
def without(place: Place) -> Iterator[None]:
    """Take a part out of a file, and put it back."""
    owner, part, _ = place
    attributes, children = owner.attributes, owner.children
    owner.attributes = {name: value for name, value in attributes.items() if name != part}
    owner.children = [one for one in children if one is not part]
    try:
        yield
    finally:
        owner.attributes, owner.children = attributes, children
