"""Write closures as joints that close loops.

A loop joint's frame is that of the closure on its child. hybridyn's own `<hybridyn:parent_pose>` keeps the
frame on its parent exactly; other programs take it from the posture of the file. A closure that is no type of
SDF is written as slides along its free axes, with massless links, and a loop joint behind them.
"""

from __future__ import annotations

from xml.etree import ElementTree as ET

import numpy as np

from ...description.placement import inverse, placement_from, turned
from ...description.records import Array, Closure, RotationKind
from ..losses import Losses
from .joints import add_axis, add_massless, add_pose, start_joint
from .posture import Posture

#: Types of joints that lock every translation, by the locked part of the rotation.
POINTS: dict[RotationKind, str] = {
    "fixed": "fixed", "parallel": "revolute", "perpendicular": "universal", "free": "ball",
}  # fmt: skip


def add_closure(root: ET.Element, closure: Closure, posture: Posture, losses: Losses) -> None:
    """Add a closure to a model.

    Args:
        posture: The posture of the file.
        losses: Receives what SDF cannot say.
    """
    if closure.translations == (0, 1, 2):
        _add(root, closure, POINTS[closure.rotation], closure.link_a, closure.frame_a, posture, losses)
    elif closure.translations == (0, 1) and closure.rotation == "fixed":
        _add(root, closure, "prismatic", closure.link_a, closure.frame_a, posture, losses)
    else:
        losses.add("closures are slides and a loop joint behind them, with massless links", closure.name)
        _add_behind_slides(root, closure, posture, losses)


def _add(
    root: ET.Element,
    closure: Closure,
    kind: str,
    link_a: str,
    frame_a: Array,
    posture: Posture,
    losses: Losses,
) -> None:
    """Add a loop joint between a link and the closure's second link."""
    turn = closure.turn
    link_b, frame_b = closure.link_b, closure.frame_b
    if link_b == "world":
        losses.add("closures with their ends exchanged, since SDF has no child 'world'", closure.name)
        link_a, frame_a, link_b, frame_b = link_b, frame_b, link_a, frame_a
    at_a = turned(frame_a, turn.T)
    at_b = turned(frame_b, turn.T)
    second = turn[:, 2]
    if kind == "universal":  # the joint's axes are those of the parent's side, its origin that of the child's
        there = inverse(posture.world[link_b]) @ posture.world[link_a] @ at_a
        at_b = placement_from(there[:3, :3], frame_b[:3, 3])
        second = there[:3, :3].T @ frame_b[:3, 2]
    element = start_joint(root, closure.name, kind, link_a, link_b)
    add_pose(element, at_b)
    add_pose(element, at_a, "hybridyn:parent_pose")
    if kind not in ("fixed", "ball"):
        add_axis(element, turn[:, 2])
    if kind == "universal":
        add_axis(element, second, "axis2")
    simbody = ET.SubElement(ET.SubElement(element, "physics"), "simbody")
    ET.SubElement(simbody, "must_be_loop_joint").text = "true"


def _add_behind_slides(root: ET.Element, closure: Closure, posture: Posture, losses: Losses) -> None:
    """Add slides along the free axes of the first frame, and a loop joint that locks every translation."""
    at_a = posture.world[closure.link_a] @ closure.frame_a
    at_b = posture.world[closure.link_b] @ closure.frame_b
    apart = at_a[:3, :3].T @ (at_b[:3, 3] - at_a[:3, 3])
    link, frame = closure.link_a, closure.frame_a
    for axis in sorted({0, 1, 2} - set(closure.translations)):
        name = f"{closure.name}_{'xyz'[axis]}"
        shift = placement_from(np.eye(3), apart[axis] * np.eye(3)[axis])
        add_massless(root, f"{name}_slider", link, frame @ shift)
        posture.world[f"{name}_slider"] = posture.world[link] @ frame @ shift
        add_axis(start_joint(root, name, "prismatic", link, f"{name}_slider"), np.eye(3)[axis])
        link, frame = f"{name}_slider", np.eye(4)
    _add(root, closure, POINTS[closure.rotation], link, frame, posture, losses)
