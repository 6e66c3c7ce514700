"""Write closures as joints that close loops.

Other programs take the frames of a loop joint from the posture of the file, in which it is closed. A closure
that is no type of SDF is written as slides along its free axes, with massless links, and a loop joint behind
them.
"""

from __future__ import annotations

from xml.etree import ElementTree as ET

import numpy as np

from ...description.placement import inverse, placement_from, turned
from ...description.records import Array, Closure, RotationKind
from ...linkage.closures import residual_of
from ..request import Losses
from .joints import add_axis, add_massless, add_pose, start_joint

#: World poses of links by name, shapes (4, 4), in the posture of the file.
Poses = dict[str, Array]

#: Opening of a closure in the posture of the file [m, or between unit axes] that is rounding.
OPEN_AT_HOME = 1e-9

#: Types of joints that lock every translation, by the locked part of the rotation.
POINTS: dict[RotationKind, str] = {
    "fixed": "fixed", "parallel": "revolute", "perpendicular": "universal", "free": "ball",
}  # fmt: skip


def add_closure(root: ET.Element, closure: Closure, poses: Poses, losses: Losses) -> None:
    """Add a closure to a model.

    Args:
        poses: Poses of the links in the posture of the file; those of sliders are added.
        losses: Receives what SDF cannot say.
    """
    if closure.translations == (0, 1, 2):
        _add(root, closure, POINTS[closure.rotation], closure.link_a, closure.frame_a, poses, losses)
    elif closure.translations == (0, 1) and closure.rotation == "fixed":
        _add(root, closure, "prismatic", closure.link_a, closure.frame_a, poses, losses)
    else:
        losses.add("closures are slides and a loop joint behind them, with massless links", closure.name)
        _add_behind_slides(root, closure, poses, losses)


def _add(
    root: ET.Element,
    closure: Closure,
    kind: str,
    link_a: str,
    frame_a: Array,
    poses: Poses,
    losses: Losses,
) -> None:
    """Add a loop joint between a link and the closure's second link."""
    link_b, frame_b = closure.link_b, closure.frame_b
    at_a, at_b = poses[link_a] @ frame_a, poses[link_b] @ frame_b
    locked = closure.translations if kind == "prismatic" else (0, 1, 2)
    off = residual_of(locked, closure.rotation, *((M[:3, :3], M[:3, 3]) for M in (at_a, at_b)))
    if np.abs(off).max() > OPEN_AT_HOME:
        losses.add("closures that are open at home are closed there", closure.name)
    if link_b == "world":
        losses.add("closures with their ends exchanged, since SDF has no child 'world'", closure.name)
        link_a, link_b = link_b, link_a
    turn = closure.turn
    at = turned(at_a, turn.T)
    element = start_joint(root, closure.name, kind, link_a, link_b)
    add_pose(element, inverse(poses[link_b]) @ at)
    if kind not in ("fixed", "ball"):
        add_axis(element, turn[:, 2])
    if kind == "universal":
        add_axis(element, at[:3, :3].T @ at_b[:3, 2], "axis2")
    simbody = ET.SubElement(ET.SubElement(element, "physics"), "simbody")
    ET.SubElement(simbody, "must_be_loop_joint").text = "true"


def _add_behind_slides(root: ET.Element, closure: Closure, poses: Poses, losses: Losses) -> None:
    """Add slides along the free axes of the first frame, and a loop joint that locks every translation."""
    at_a = poses[closure.link_a] @ closure.frame_a
    at_b = poses[closure.link_b] @ closure.frame_b
    apart = at_a[:3, :3].T @ (at_b[:3, 3] - at_a[:3, 3])
    link, frame = closure.link_a, closure.frame_a
    for axis in sorted({0, 1, 2} - set(closure.translations)):
        name = f"{closure.name}_{'xyz'[axis]}"
        shift = placement_from(np.eye(3), apart[axis] * np.eye(3)[axis])
        add_massless(root, f"{name}_slider", link, frame @ shift)
        poses[f"{name}_slider"] = poses[link] @ frame @ shift
        add_axis(start_joint(root, name, "prismatic", link, f"{name}_slider"), np.eye(3)[axis])
        link, frame = f"{name}_slider", np.eye(4)
    _add(root, closure, POINTS[closure.rotation], link, frame, poses, losses)
