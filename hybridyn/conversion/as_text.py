"""Numbers, rotations and inertias as text, and elements of XML, which read back as the same."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import atan2, cos, hypot, sin
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from ..description.records import Array
from ..spatial import quaternion_from_rotation


def numeral(value: float) -> str:
    """Return the shortest text that reads back as the same number; whole numbers have no point."""
    text = repr(float(value) + 0.0)  # -0.0 becomes 0.0
    return text.removesuffix(".0")


def numerals(values: Iterable[float]) -> str:
    """Return numbers with spaces between them."""
    return " ".join(numeral(value) for value in values)


def add(parent: ET.Element, tag: str, **attributes: str | float | Iterable[float] | None) -> ET.Element:
    """Add an element and return it; see `put`."""
    out = ET.SubElement(parent, tag)
    put(out, **attributes)
    return out


def put(element: ET.Element, **attributes: str | float | Iterable[float] | None) -> None:
    """Set attributes: texts, numbers that read back as the same, or none."""
    for name, value in attributes.items():
        if isinstance(value, str):
            element.set(name, value)
        elif value is not None:
            element.set(name, numerals(value if isinstance(value, Iterable) else [value]))


#: What an element holds: "@name" is an attribute, "" its text, others are children: mappings, or texts; a
#: list is several of one name. None is left out. Texts may be numbers, which read back as the same.
Content = Mapping[str, Any]


def element(tag: str, content: Content) -> ET.Element:
    """Return an element with its content."""
    out = ET.Element(tag)
    for name, stated in content.items():
        for value in stated if isinstance(stated, list) else [stated]:
            if isinstance(value, Mapping):
                out.append(element(name, value))
            elif value is not None:
                text = value if isinstance(value, str) else numerals(np.ravel(value))
                if name.startswith("@"):
                    out.set(name[1:], text)
                else:
                    (ET.SubElement(out, name) if name else out).text = text
    return out


def document(tag: str, content: Content) -> str:
    """Return the text of an XML file, whose root has a content."""
    root = element(tag, content)
    ET.indent(root)
    return f'<?xml version="1.0"?>\n{ET.tostring(root, encoding="unicode")}\n'


def angles_of(rotation: Array) -> tuple[float, float, float]:
    """Compute roll, pitch and yaw [rad], the inverse of `placement.rotation_from_rpy`.

    Roll is computed with yaw already taken away, so that the product is right to rounding near pitch = 90
    degrees, too.

    Args:
        rotation: Rotation matrix, shape (3, 3).
    """
    r = [[float(x) for x in row] for row in rotation]
    yaw = atan2(r[1][0], r[0][0])
    s, c = sin(yaw), cos(yaw)
    pitch = atan2(-r[2][0], hypot(r[0][0], r[1][0]))
    roll = atan2(s * r[0][2] - c * r[1][2], c * r[1][1] - s * r[0][1])
    return roll, pitch, yaw


def quaternion_of(rotation: Array) -> list[float]:
    """Return the quaternion w, x, y, z of a rotation matrix, shape (3, 3), with w >= 0."""
    x, y, z, w = (float(part) for part in quaternion_from_rotation(rotation))
    return [w, x, y, z]


def principal(inertia: Array) -> tuple[Array, Array]:
    """Return the principal moments of an inertia, shape (3,), and their axes as columns, shape (3, 3)."""
    if not np.any(inertia - np.diag(np.diag(inertia))):
        return np.diag(inertia).copy(), np.eye(3)
    moments, axes = np.linalg.eigh(inertia)
    return moments, -axes if np.linalg.det(axes) < 0 else axes
