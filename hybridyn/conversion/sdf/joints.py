"""Write joints of the tree, closures as joints that close loops, and couplings as `<mimic>`.

Other programs take the frames of a loop joint from the posture of the file, in which it is closed. A closure
that is no type of SDF is written as slides along its free axes, with massless links, and a loop joint behind
them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from ...description.placement import inverse, placement_from, turned
from ...description.records import Array, Closure, Coupling, Joint, RotationKind
from ...description.robot_file import FREEDOMS
from ...description.sdf.elements import NUMBERS
from ...linkage.closures import residual_of
from ..numerals import angles_of, numerals
from ..request import Losses, add_limits, add_name

#: World poses of links by name, shapes (4, 4), in the posture of the file.
Poses = dict[str, Array]

#: Joints and links of slides by name: the axis of each, shape (3,), and its position [m].
Slides = Mapping[tuple[str, str], tuple[Array, float]]

#: Types of joints in SDF; a planar joint is two slides and an endless hinge.
TYPES = {
    "fixed": "fixed", "revolute": "revolute", "continuous": "continuous", "prismatic": "prismatic",
    "spherical": "ball", "planar": "continuous",
}  # fmt: skip

#: What becomes of joints that are no type of SDF.
REPLACED = {
    "floating": "floating joints have the name of their link and _free, and start at the world",
    "planar": "planar joints are two slides and a hinge",
}

#: Types of joints that lock every translation, by the locked part of the rotation.
POINTS: dict[RotationKind, str] = {
    "fixed": "fixed", "parallel": "revolute", "perpendicular": "universal", "free": "ball",
}  # fmt: skip

#: Opening of a closure in the posture of the file [m, or between unit axes] that is rounding.
OPEN_AT_HOME = 1e-9


def add(
    parent: ET.Element, tag: str, content: Mapping[str, Any] | None = None, **attributes: str
) -> ET.Element:
    """Add an element and return it; its content is children by tag with a text, a number or several."""
    out = ET.SubElement(parent, tag, attributes)
    for name, value in (content or {}).items():
        ET.SubElement(out, name).text = value if isinstance(value, str) else numerals(np.ravel(value))
    return out


def add_pose(element: ET.Element, placement: Array, **attributes: str) -> None:
    """Add a placement (4, 4) as position, roll, pitch and yaw; none for the identity without attributes."""
    if attributes or not np.array_equal(placement, np.eye(4)):
        pose = ET.SubElement(element, "pose", attributes)
        pose.text = f"{numerals(placement[:3, 3])} {numerals(angles_of(placement[:3, :3]))}"


def add_inertial(link: ET.Element, mass: float, com: Array, inertia: Array) -> None:
    """Add mass, centre of mass and inertia, which SDF otherwise takes as 1 kg and 1 kg m^2."""
    at = {"pose": np.append(com, np.zeros(3))} if com.any() else {}
    inertial = add(link, "inertial", at | {"mass": mass})
    add(inertial, "inertia", dict(zip(NUMBERS["inertia"], inertia[np.triu_indices(3)], strict=True)))


def start_joint(root: ET.Element, name: str, kind: str, parent: str, child: str) -> ET.Element:
    """Add a joint of a type of SDF between two links, of which the parent may be "world", and return it."""
    return add(root, "joint", {"parent": parent, "child": child}, name=name, type=kind)


def add_joint(
    root: ET.Element, joint: Joint, spring: tuple[float, float], poses: Poses, losses: Losses
) -> ET.Element | None:
    """Add a joint of the tree and return it; None for a floating joint, which SDF states by having none.

    Args:
        root: The model.
        joint: The joint.
        spring: Stiffness and rest position of its spring; stiffness 0 for none.
        poses: Poses of the links in the posture of the file.
        losses: Receives what SDF cannot say.
    """
    if joint.kind in REPLACED:
        losses.add(REPLACED[joint.kind], joint.name)
    numbers = joint.damping, joint.friction, joint.rotor_inertia, joint.gear_ratio - 1
    if FREEDOMS[joint.kind] > 1 and any(numbers):
        losses.add("damping, friction and rotors of joints with several freedoms", joint.name)
    add_limits(joint, losses)
    if joint.kind == "floating":
        return None
    parent = joint.parent
    if joint.kind == "planar":
        slides = {
            (f"{joint.name}_{x}", f"{joint.child}_{x}"): (np.eye(3)[i], 0.0) for i, x in enumerate("xy")
        }
        parent = _add_slides(root, parent, joint.placement, slides, poses)
    element = start_joint(root, joint.name, TYPES[joint.kind], parent, joint.child)
    if joint.kind in ("fixed", "spherical"):
        return element
    single = FREEDOMS[joint.kind] == 1
    if single and joint.rotor_inertia:
        ET.SubElement(element, "drake:rotor_inertia").text = numerals([joint.rotor_inertia])
    if single and joint.gear_ratio != 1:
        ET.SubElement(element, "drake:gear_ratio").text = numerals([joint.gear_ratio])
    axis = add(element, "axis", {"xyz": joint.axis})
    if single:
        _add_numbers(axis, joint, spring)
    return element


def _add_numbers(axis: ET.Element, joint: Joint, spring: tuple[float, float]) -> None:
    """Add the finite limits, the friction and the spring of a joint with one freedom."""
    words = ("effort", "velocity") if joint.kind == "continuous" else ("lower", "upper", "effort", "velocity")
    limits = {word: getattr(joint, word) for word in words if np.isfinite(getattr(joint, word))}
    if limits:
        add(axis, "limit", limits)
    stiffness, rest = spring
    if joint.damping or joint.friction or stiffness:
        forces = joint.damping, joint.friction, rest, stiffness
        add(axis, "dynamics", dict(zip(NUMBERS["dynamics"], forces, strict=True)))


def _add_slides(root: ET.Element, link: str, frame: Array, slides: Slides, poses: Poses) -> str:
    """Add slides from a frame (4, 4) of a link, each with a massless link, and return the last one.

    Args:
        root: The model.
        link: The link.
        frame: The frame.
        slides: The slides.
        poses: Poses of the links in the posture of the file; those of the massless links are added.
    """
    for (name, slider), (axis, position) in slides.items():
        shift = placement_from(np.eye(3), position * axis)
        element = add(root, "link", name=slider)
        add_pose(element, frame @ shift, relative_to="__model__" if link == "world" else link)
        add_inertial(element, 0.0, np.zeros(3), np.zeros((3, 3)))
        add(start_joint(root, name, "prismatic", link, slider), "axis", {"xyz": axis})
        poses[slider] = poses[link] @ frame @ shift
        link, frame = slider, np.eye(4)
    return link


def add_closure(root: ET.Element, closure: Closure, poses: Poses, losses: Losses) -> None:
    """Add a closure to a model.

    Args:
        root: The model.
        closure: The closure.
        poses: Poses of the links in the posture of the file; those of sliders are added.
        losses: Receives what SDF cannot say.
    """
    link, frame, kind = closure.link_a, closure.frame_a, POINTS[closure.rotation]
    if closure.translations == (0, 1) and closure.rotation == "fixed":
        kind = "prismatic"
    elif closure.translations != (0, 1, 2):
        losses.add("closures are slides and a loop joint behind them, with massless links", closure.name)
        at_a, at_b = poses[link] @ frame, poses[closure.link_b] @ closure.frame_b
        apart = at_a[:3, :3].T @ (at_b[:3, 3] - at_a[:3, 3])
        names = {i: f"{closure.name}_{'xyz'[i]}" for i in range(3) if i not in closure.translations}
        slides = {(name, f"{name}_slider"): (np.eye(3)[i], apart[i]) for i, name in names.items()}
        link, frame = _add_slides(root, link, frame, slides, poses), np.eye(4)
    _add_loop_joint(root, closure, kind, (link, closure.link_b), (frame, closure.frame_b), poses, losses)


def _add_loop_joint(
    root: ET.Element, closure: Closure, kind: str, links: tuple[str, str], frames: tuple[Array, Array],
    poses: Poses, losses: Losses,
) -> None:  # fmt: skip
    """Add a joint of a type of SDF that closes a loop between frames of two links."""
    at_a, at_b = (poses[link] @ frame for link, frame in zip(links, frames, strict=True))
    locked = closure.translations if kind == "prismatic" else (0, 1, 2)
    off = residual_of(locked, closure.rotation, *((M[:3, :3], M[:3, 3]) for M in (at_a, at_b)))
    if np.abs(off).max() > OPEN_AT_HOME:
        losses.add("closures that are open at home are closed there", closure.name)
    parent, child = links
    if child == "world":
        losses.add("closures with their ends exchanged, since SDF has no child 'world'", closure.name)
        parent, child = child, parent
    at = turned(at_a, closure.turn.T)
    element = start_joint(root, closure.name, kind, parent, child)
    add_pose(element, inverse(poses[child]) @ at)
    if kind not in ("fixed", "ball"):
        add(element, "axis", {"xyz": closure.turn[:, 2]})
    if kind == "universal":
        add(element, "axis2", {"xyz": at[:3, :3].T @ at_b[:3, 2]})
    add(add(element, "physics"), "simbody", {"must_be_loop_joint": "true"})


def add_couplings(
    couplings: Iterable[Coupling], joints: Mapping[str, ET.Element], losses: Losses
) -> list[Coupling]:
    """Add couplings of two joints to a model, and return those that SDF cannot say.

    One of the two joints, which follows no other yet, follows the other one.

    Args:
        couplings: The couplings.
        joints: Element of each joint.
        losses: Receives names of couplings.
    """
    left = []
    for coupling in couplings:
        ends = (coupling.terms, coupling.terms[::-1]) if len(coupling.terms) == 2 else ()
        for (follower, own), (leader, other) in ends:
            axis = joints[follower].find("axis")
            if axis is not None and axis.find("mimic") is None:
                add_name(coupling, follower, losses)
                numbers = -other / own, coupling.offset / own, 0.0
                add(axis, "mimic", dict(zip(NUMBERS["mimic"], numbers, strict=True)), joint=leader)
                break
        else:
            left.append(coupling)
    return left
