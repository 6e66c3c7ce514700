"""Write joints of the tree, axes with their numbers, and poses."""

from __future__ import annotations

from xml.etree import ElementTree as ET

import numpy as np

from ...description.records import Array, Joint
from ..numerals import angles_of, numeral, numerals
from ..request import Losses, add_limits

#: Types of joints in SDF.
TYPES = {
    "fixed": "fixed", "revolute": "revolute", "continuous": "continuous", "prismatic": "prismatic",
    "spherical": "ball",
}  # fmt: skip

#: Axes of the slides that stand for a planar joint.
SLIDES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0)}


def add_pose(element: ET.Element, placement: Array, **attributes: str) -> None:
    """Add a pose as position, roll, pitch and yaw, unless it is the identity and relative to nothing named.

    Args:
        element: The element that receives it.
        placement: The pose, shape (4, 4).
        attributes: Attributes of the pose's element.
    """
    if np.array_equal(placement, np.eye(4)) and not attributes:
        return
    pose = ET.SubElement(element, "pose", attributes)
    pose.text = f"{numerals(placement[:3, 3])} {numerals(angles_of(placement[:3, :3]))}"


def add_number(element: ET.Element, tag: str, value: float) -> None:
    """Add an element whose text is a number."""
    ET.SubElement(element, tag).text = numeral(value)


def start_joint(root: ET.Element, name: str, kind: str, parent: str, child: str) -> ET.Element:
    """Add a joint between two links and return it.

    Args:
        kind: Its type in SDF.
        parent: Name of the parent link, or "world".
        child: Name of the child link.
    """
    element = ET.SubElement(root, "joint", name=name, type=kind)
    ET.SubElement(element, "parent").text = parent
    ET.SubElement(element, "child").text = child
    return element


def add_axis(element: ET.Element, axis: Array, tag: str = "axis") -> ET.Element:
    """Add an axis in the joint's own frame and return it."""
    out = ET.SubElement(element, tag)
    ET.SubElement(out, "xyz").text = numerals(axis)
    return out


def add_joint(
    root: ET.Element, joint: Joint, spring: tuple[float, float], losses: Losses
) -> ET.Element | None:
    """Add a joint of the tree and return it; None for a floating joint, which SDF states by having none.

    Args:
        spring: Stiffness and rest position of its spring; stiffness 0 for none.
        losses: Receives what SDF cannot say.
    """
    if joint.kind == "floating":
        losses.add(
            "floating joints have the name of their link and _free, and start at the world", joint.name
        )
        _add_lost_numbers(joint, losses)
        return None
    if joint.kind == "planar":
        return _add_planar(root, joint, losses)
    element = start_joint(root, joint.name, TYPES[joint.kind], joint.parent, joint.child)
    if joint.kind == "spherical":
        _add_lost_numbers(joint, losses)
    if joint.kind in ("fixed", "spherical"):
        return element
    if joint.rotor_inertia:
        add_number(element, "drake:rotor_inertia", joint.rotor_inertia)
    if joint.gear_ratio != 1:
        add_number(element, "drake:gear_ratio", joint.gear_ratio)
    axis = add_axis(element, joint.axis)
    _add_limit(axis, joint)
    stiffness, rest = spring
    if joint.damping or joint.friction or stiffness:
        dynamics = ET.SubElement(axis, "dynamics")
        add_number(dynamics, "damping", joint.damping)
        add_number(dynamics, "friction", joint.friction)
        add_number(dynamics, "spring_reference", rest)
        add_number(dynamics, "spring_stiffness", stiffness)
    return element


def _add_lost_numbers(joint: Joint, losses: Losses) -> None:
    """List a joint with several freedoms whose numbers SDF cannot say."""
    if joint.damping or joint.friction or joint.rotor_inertia or joint.gear_ratio != 1:
        losses.add("damping, friction and rotors of joints with several freedoms", joint.name)
    add_limits(joint, losses)


def _add_limit(axis: ET.Element, joint: Joint) -> None:
    """Add the finite limits."""
    bounds = {"effort": joint.effort, "velocity": joint.velocity}
    if joint.kind != "continuous":
        bounds = {"lower": joint.lower, "upper": joint.upper, **bounds}
    bounds = {tag: value for tag, value in bounds.items() if np.isfinite(value)}
    if bounds:
        limit = ET.SubElement(axis, "limit")
        for tag, value in bounds.items():
            add_number(limit, tag, value)


def _add_planar(root: ET.Element, joint: Joint, losses: Losses) -> ET.Element:
    """Add two slides and a hinge with massless links between them."""
    losses.add("planar joints are two slides and a hinge", joint.name)
    _add_lost_numbers(joint, losses)
    parent, at = joint.parent, joint.placement
    for word, axis in SLIDES.items():
        link = f"{joint.child}_{word}"
        add_massless(root, link, parent, at)
        add_axis(start_joint(root, f"{joint.name}_{word}", "prismatic", parent, link), np.array(axis))
        parent, at = link, np.eye(4)
    element = start_joint(root, joint.name, "continuous", parent, joint.child)
    add_axis(element, joint.axis)
    return element


def add_massless(root: ET.Element, name: str, parent: str, at: Array) -> None:
    """Add a link without mass.

    Args:
        parent: Name of the link relative to which it stands.
        at: Its pose there, shape (4, 4).
    """
    link = ET.SubElement(root, "link", name=name)
    add_pose(link, at, relative_to="__model__" if parent == "world" else parent)
    add_inertial(link, 0.0, np.zeros(3), np.zeros((3, 3)))


def add_inertial(link: ET.Element, mass: float, com: Array, inertia: Array) -> None:
    """Add mass, centre of mass and inertia, which SDF otherwise takes as 1 kg and 1 kg m^2."""
    inertial = ET.SubElement(link, "inertial")
    if com.any():
        ET.SubElement(inertial, "pose").text = f"{numerals(com)} 0 0 0"
    add_number(inertial, "mass", mass)
    tensor = ET.SubElement(inertial, "inertia")
    words = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    for word, moment in zip(words, inertia[np.triu_indices(3)], strict=True):
        add_number(tensor, word, float(moment))
