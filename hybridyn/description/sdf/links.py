"""Links of an SDF file, with SDFormat's defaults: a link without `<inertial>` weighs 1 kg."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ..names import listed
from ..records import Array, Link
from ..robot_file import RobotFile
from ..urdf.xml_node import Node
from . import fields
from .models import Item

#: Moments of inertia by name, with SDFormat's defaults [kg m^2].
MOMENTS = {"ixx": 1.0, "ixy": 0.0, "ixz": 0.0, "iyy": 1.0, "iyz": 0.0, "izz": 1.0}


def add_links(robot: RobotFile, links: Iterable[Item]) -> None:
    """Add every link to the robot, in the order of the file; note those with SDFormat's default inertia.

    Raises:
        ModelError: A number is invalid, or a link states forces that hybridyn does not have.
    """
    assumed: list[str] = []
    for item in links:
        robot.links.append(_link(item, robot, assumed))
    if assumed:
        robot.notes.append(
            f"{listed(assumed)}: no mass or inertia is stated, so SDFormat's default counts "
            "(1 kg, 1 kg m^2 about each axis)"
        )


def _link(item: Item, robot: RobotFile, assumed: list[str]) -> Link:
    node = item.node
    _refuse_forces(node)
    line = node.line if node.file == robot.file else None
    inertial = node.child("inertial")
    if inertial is None:
        assumed.append(item.full_name)
        return Link(item.full_name, 1.0, np.zeros(3), np.eye(3), line)
    _refuse_unread(inertial)
    tensor = inertial.child("inertia")
    if tensor is None or not fields.word(inertial, "mass"):
        assumed.append(item.full_name)
    weight = fields.number(inertial, "mass", 1.0)
    if weight < 0:
        raise inertial.error(f"link '{item.full_name}' has a negative mass ({weight:g} kg)")
    at = fields.pose(inertial.child("pose"))
    turn = at[:3, :3]
    inertia = turn @ _tensor(tensor) @ turn.T
    return Link(item.full_name, weight, at[:3, 3], (inertia + inertia.T) / 2, line)


def _tensor(node: Node | None) -> Array:
    """Return the matrix of an `<inertia>`, shape (3, 3) [kg m^2]."""
    ixx, ixy, ixz, iyy, iyz, izz = (fields.number(node, name, default) for name, default in MOMENTS.items())
    return np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])


def _refuse_unread(inertial: Node) -> None:
    """Refuse inertia that a program computes, and that of displaced fluid."""
    if inertial.flag("auto", False):
        raise inertial.error(
            'auto="true": inertia of shapes is not computed; write <mass>, <pose> and <inertia>'
        )
    frame = fields.relative_to(inertial.child("pose"))
    if frame:
        raise inertial.error(f"its pose is relative to '{frame}'; SDFormat has it in the link's frame")
    added = inertial.child("fluid_added_mass")
    if added is not None and any(fields.number(added, entry.tag) for entry in added.children()):
        raise added.error("the inertia of displaced fluid is not read; remove it")


def _refuse_forces(node: Node) -> None:
    """Refuse what makes a link move otherwise than a rigid body under gravity."""
    if not fields.flag(node, "gravity", True):
        raise node.error("<gravity>false</gravity> is not read; remove it, or load the robot without gravity")
    if fields.flag(node, "kinematic"):
        raise node.error("a program moves a kinematic link; remove <kinematic>")
    decay = node.child("velocity_decay")
    if decay is not None and (fields.number(decay, "linear") or fields.number(decay, "angular")):
        raise decay.error("damping of a link's speed is not read; set it to 0, or put damping on joints")
