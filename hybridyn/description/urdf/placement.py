"""Read placements (4, 4) and axes from elements: roll-pitch-yaw, quaternions, direction vectors."""

from __future__ import annotations

import numpy as np

from ..placement import placement_from, rotation_from_quaternion, rotation_from_rpy
from ..records import Array
from .xml_node import Node

#: Shortest axis or quaternion with a direction; files write unit vectors with rounding, zero is a mistake.
SMALLEST_AXIS = 1e-12


def origin_of(node: Node | None) -> Array:
    """Return the placement that an element states, shape (4, 4); the identity for None.

    The attributes are `xyz` [m] and either `rpy` [rad] or `quat_xyzw` (URDF 1.1).

    Raises:
        ModelError: A number does not parse, the quaternion is zero, or both orientations are given.
    """
    if node is None:
        return np.eye(4)
    position = node.numbers("xyz", 3, (0, 0, 0))
    if "quat_xyzw" not in node.xml.attrib:
        return placement_from(rotation_from_rpy(*node.numbers("rpy", 3, (0, 0, 0))), position)
    if "rpy" in node.xml.attrib:
        raise node.error("states both 'rpy' and 'quat_xyzw'; keep one")
    quaternion = node.numbers("quat_xyzw", 4)
    norm = float(np.linalg.norm(quaternion))
    if norm < SMALLEST_AXIS:
        raise node.error("quat_xyzw is zero; a unit quaternion is needed")
    return placement_from(rotation_from_quaternion(*(quaternion / norm)), position)


def axis_of(node: Node | None) -> Array:
    """Return the unit vector that an `<axis xyz>` element states, shape (3,); x for None.

    Raises:
        ModelError: A number does not parse, or the axis is zero.
    """
    if node is None:
        return np.array([1.0, 0.0, 0.0])
    return unit(node, node.numbers("xyz", 3), 'xyz="0 0 1"')


def unit(node: Node, axis: Array, example: str) -> Array:
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
