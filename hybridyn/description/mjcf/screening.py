"""Refuse or remove elements before MuJoCo compiles the file.

Visuals, sensors, cameras, lights and contacts are removed: they do not change the dynamics that hybridyn
computes. MuJoCo then opens no files, and allocates memory for the robot only.
"""

from __future__ import annotations

import os
import re

from lxml import etree

from ..urdf.xml_node import LARGEST_NUMBER, Node
from .document import Document

#: Elements that do not change the dynamics that hybridyn computes.
LEFT_OUT = {
    "visual", "statistic", "size", "sensor", "custom", "contact", "camera", "light", "texture", "material",
    "skin", "pair", "exclude", "extension",
}  # fmt: skip

#: Elements that are refused, with a description and the correction.
REFUSED = {
    "flexcomp": "a deformable body; hybridyn's bodies are rigid: describe it by rigid bodies and springs",
    "flex": "a deformable body; hybridyn's bodies are rigid: describe it by rigid bodies and springs",
    "composite": "a body made of many; hybridyn does not read it: save the compiled model (mj_saveLastXML)",
    "plugin": "a plugin, whose forces hybridyn cannot know; remove it, and put springs and dampers on joints",
}

#: Attributes that hold names, which may look like numbers.
NAMES = {
    "name", "class", "childclass", "joint", "joint1", "joint2", "body", "body1", "body2", "site", "site1",
    "site2", "tendon", "tendon1", "tendon2", "mesh", "hfield", "material", "prefix", "file", "model", "geom",
    "geom1", "geom2", "jointinparent", "cranksite", "slidersite", "refsite", "target", "meshdir",
    "texturedir", "assetdir",
}  # fmt: skip

#: Attributes that `<plugin>` in `<actuator>` has in common with motors.
OF_ACTUATORS = {
    "name", "class", "joint", "jointinparent", "tendon", "site", "refsite", "body", "cranksite", "slidersite",
    "gear", "forcerange", "forcelimited", "armature", "damping",
}  # fmt: skip

#: Most elements, replicas counted; the time of MuJoCo's compiler grows with the square of their number.
MOST_COMPILED = 50_000

_UNBOUNDED = re.compile(r"[+-]?(inf(inity)?|nan)", re.IGNORECASE)
_NUMERAL = re.compile(r"[+-]?\.?\d")


def screen(document: Document) -> None:
    """Refuse what cannot be read, and remove what does not change the dynamics.

    Args:
        document: The file; its tree is changed.

    Raises:
        ModelError: An element is refused, a number is not finite, or elements are too many.
    """
    for node in list(document.nodes()):
        if node.tag in LEFT_OUT:
            _take_out(node)
        elif node.tag == "plugin":
            _take_plugin(document, node)
    for node in document.nodes():
        if node.tag in REFUSED:
            raise node.error(REFUSED[node.tag])
        for name in node.attributes():
            if name not in NAMES:
                _refuse_unbounded(node, name)
        node.xml.attrib.pop("material", "")
        if node.tag == "hfield":
            _flatten(node)
    _refuse_too_many(document)


def _take_plugin(document: Document, node: Node) -> None:
    """Take a plugin out that only makes a shape; one in `<actuator>` becomes a servo, whose law is not read.

    A geom of such a shape is taken out where the body states its inertia. Others are refused later.
    """
    above = node.xml.getparent()
    assert above is not None
    place = "{}:{}: ".format(*node.place) + f"<plugin> in <{above.tag}>"
    if above.tag == "actuator":
        node.xml.tag = "general"
        for name in set(node.attributes()) - OF_ACTUATORS:
            del node.xml.attrib[name]
        node.xml.set("biastype", "affine")
        for child in list(node.xml):
            node.xml.remove(child)
    elif above.tag == "geom" and _has_mass(next(above.iterancestors())):
        _take_out(Node(above, node.file))
        document.notes.append(f"{place} is not read: it only makes a shape, without mass")
    elif above.tag == "mesh":
        _take_out(node)
        document.notes.append(f"{place} is not read: it only makes a shape")


def _has_mass(body: etree._Element) -> bool:
    """Say whether a body needs no geom for its mass: it states it, or it is the world."""
    return body.tag == "worldbody" or body.find("inertial") is not None


def _take_out(node: Node) -> None:
    parent = node.xml.getparent()
    if parent is not None:
        parent.remove(node.xml)


def _refuse_unbounded(node: Node, name: str) -> None:
    """Refuse numbers that are not finite or absurdly large; ranges may be infinite."""
    for word in str(node.xml.get(name, "")).split():
        if _UNBOUNDED.fullmatch(word):
            if not name.endswith("range") or "nan" in word.lower():
                raise node.error(f"attribute '{name}': '{word}' is not a finite number")
        elif _NUMERAL.match(word) and abs(_number(word)) > LARGEST_NUMBER:
            raise node.error(f"attribute '{name}': '{word[:40]}' is too large (limit {LARGEST_NUMBER:g})")


def _number(word: str) -> float:
    """Return a number, or 0 for what is none: MuJoCo refuses that itself."""
    try:
        return float(word)
    except ValueError:
        return 0.0


def _flatten(node: Node) -> None:
    """Replace a terrain by a flat one of the same size: it has no mass, and may be large."""
    file = os.path.basename(str(node.xml.get("file", "")))
    node.xml.set("name", str(node.xml.get("name") or os.path.splitext(file)[0]))
    for name in ("file", "content_type", "elevation"):
        node.xml.attrib.pop(name, "")
    node.xml.set("nrow", "2")
    node.xml.set("ncol", "2")


def _refuse_too_many(document: Document) -> None:
    """Refuse a robot that would take MuJoCo minutes, or all memory."""
    factors: dict[object, float] = {}
    total = 0.0
    attached = sum(1 for model in document.every()[1:] for _ in model.nodes())
    for node in document.nodes():
        factor = factors.get(node.xml.getparent(), 1.0)
        if node.tag == "replicate":
            factor *= max(1.0, abs(node.number("count")))
        factors[node.xml] = factor
        total += factor * (1 + attached if node.tag == "attach" else 1)
        if total > MOST_COMPILED:
            raise node.error(
                f"with its replicas, the file has more than {MOST_COMPILED:,} elements up to here"
            )
