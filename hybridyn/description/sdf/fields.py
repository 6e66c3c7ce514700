"""Read the texts and numbers of SDFormat's elements: its values are texts of children, not attributes."""

from __future__ import annotations

import numpy as np

from ..placement import placement_from, rotation_from_quaternion, rotation_from_rpy
from ..records import Array
from ..urdf.placement import SMALLEST_AXIS
from ..urdf.xml_node import Node

#: Deviation of a quaternion's length from 1 that is rounding: files keep 4 digits and more. Programs disagree
#: on what longer and shorter ones mean.
QUATERNION_SLACK = 1e-3

#: Largest limit that is one: SDFormat's defaults before version 1.9 are -1e16 and 1e16.
UNLIMITED = 1e16


def word(node: Node, tag: str) -> str:
    """Return the text of a child, "" if it is absent.

    Raises:
        ModelError: The child is stated twice.
    """
    child = node.child(tag)
    return "" if child is None else child.content()


def name_of(own: Node, model: Node) -> str:
    """Return the name of a model.

    Args:
        own: The element `<include>`, which may name it, or the model itself.
        model: The element `<model>`.
    """
    return (word(own, "name") if own.tag == "include" else "") or model.text("name")


def number(node: Node | None, tag: str, default: float = 0.0, *, infinite: bool = False) -> float:
    """Return the number in a child.

    Args:
        node: The element, or None where it is absent.
        tag: Name of the child.
        default: The number of an absent or empty child.
        infinite: Whether `inf` and `-inf` are numbers, too.

    Raises:
        ModelError: The text is no number, or the child is stated twice.
    """
    child = None if node is None else node.child(tag)
    return default if child is None or not child.content() else child.content_number(infinite=infinite)


def flag(node: Node, tag: str, default: bool = False) -> bool:
    """Return a child as true or false; the default if it is absent or empty.

    Raises:
        ModelError: The text is neither, or the child is stated twice.
    """
    child = node.child(tag)
    if child is None or not child.content():
        return default
    text = child.content().lower()
    if text not in ("true", "false", "1", "0"):
        raise child.error(f"text '{text[:40]}' instead of true or false")
    return text in ("true", "1")


def direction(node: Node) -> Array:
    """Return the unit vector that an element states, shape (3,).

    Raises:
        ModelError: A number does not parse, or the vector is zero.
    """
    axis = node.content_numbers(3)
    norm = float(np.linalg.norm(axis))
    if norm < SMALLEST_AXIS:
        raise node.error("the axis is zero; give a direction such as <xyz>0 0 1</xyz>")
    return axis / norm


def pose(node: Node | None) -> Array:
    """Return the placement that a `<pose>` states, shape (4, 4); the identity for None or an empty text.

    Raises:
        ModelError: A number does not parse, a quaternion is zero, or an attribute is unknown.
    """
    if node is None or not node.content():
        return np.eye(4)
    form = str(node.xml.get("rotation_format", "")).strip() or "euler_rpy"
    degrees = node.flag("degrees", False)
    if form == "quat_xyzw":
        if degrees:
            raise node.error("states both degrees and a quaternion; keep one")
        numbers = node.content_numbers(7)
        norm = float(np.linalg.norm(numbers[3:]))
        if abs(norm - 1) > QUATERNION_SLACK:
            raise node.error(f"its quaternion has length {norm:g}; a unit quaternion is needed")
        return placement_from(rotation_from_quaternion(*(numbers[3:] / norm)), numbers[:3])
    if form != "euler_rpy":
        raise node.error(f"rotation_format '{form}' instead of 'euler_rpy' or 'quat_xyzw'")
    numbers = node.content_numbers(6)
    angles = np.radians(numbers[3:]) if degrees else numbers[3:]
    return placement_from(rotation_from_rpy(*angles), numbers[:3])


def relative_to(node: Node | None) -> str:
    """Return the name of the frame in which a `<pose>` is expressed, "" for the default.

    Raises:
        ModelError: It names a frame in the attribute of SDFormat 1.5 and 1.6, which never had a meaning.
    """
    if node is None:
        return ""
    if (frame := str(node.xml.get("frame", "")).strip()) and not node.xml.get("relative_to"):
        raise node.error(
            f'frame="{frame}": this attribute of SDFormat 1.5 and 1.6 never had a meaning; write '
            f'relative_to="{frame}" and version="1.7", or remove it'
        )
    return str(node.xml.get("relative_to", "")).strip()
