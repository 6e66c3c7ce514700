"""Keep a joint that closes a loop and has damping, dry friction or a spring: these need its position.

As in SDF and USD, the joint stays in the tree. A massless link becomes its child, and a fixed closure welds
this link to the other one. A screw is kept, too: no closure is one.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...joints.kinds import JointKind
from ...spatial import rotation_from_axis_angle
from ..closure_forms import closure_of
from ..names import DROPS, listed, unique
from ..placement import placement_from, relative
from ..records import Array, Closure, Joint, RobotFile, StatedSpring, massless
from .xml_node import XmlNode

#: Forces of a joint that need its position.
FORCES = ("damping", "friction", "spring_stiffness")
#: Kinds of closures with one freedom: as joints.
KINDS: dict[str, JointKind] = {
    kind.value: JointKind.REVOLUTE if kind.hinge else kind
    for kind in JointKind
    if kind.single and kind.closure
}
Z = np.array([0.0, 0.0, 1.0])


def keep_joint(
    robot: RobotFile,
    closure: Closure,
    forces: Mapping[str, float],
    poses: Mapping[str, Array],
    node: XmlNode,
    pitch: float = 0.0,
) -> None:
    """Add a closure to a robot: as a joint of the tree if it has forces, or is a screw.

    Args:
        robot: The robot.
        closure: The joint as a closure.
        forces: What the file states of `FORCES` and `spring_reference`, [SI].
        poses: Pose of each link where all joints are at zero, shapes (4, 4); the joint is at zero there, too.
        node: The element that states the forces, for messages.
        pitch: Way of a screw per turn [m/rad]; its closure is cylindrical.
    """
    stated = [word for word in FORCES if forces.get(word)]
    known = {closure.link_a, closure.link_b} <= {*poses}  # `validate` refuses others
    if not known or not (pitch or (stated and closure.kind in KINDS)):
        if stated and known:
            robot.notes.append(
                f"{node.at}: {DROPS} {listed(stated)} of closure '{closure.name}': its kind, {closure.kind}, "
                "has not one freedom"
            )
        robot.closures.append(closure)
        return
    kind = JointKind.SCREW if pitch else KINDS[closure.kind]
    _add_joint(robot, closure, kind, forces, pitch, _at_zero(closure, kind, poses))


def _add_joint(
    robot: RobotFile, closure: Closure, kind: JointKind, forces: Mapping[str, float], pitch: float, at: Array
) -> None:
    """Add a closure to a robot as a joint to a massless link, which is welded to the other link.

    Args:
        at: Motion that takes the joint's second frame onto its first where the robot is at zero, (4, 4).
    """
    taken = {link.name for link in robot.links}
    link = unique(f"{closure.link_b}_at_{closure.name}", taken)
    robot.links.append(massless(link, closure.line, between=True))
    robot.joints.append(Joint(
        closure.name, kind, closure.link_a, link, closure.frame_a, Z, damping=forces.get("damping", 0.0),
        friction=forces.get("friction", 0.0), pitch=pitch, line=closure.line,
    ))  # fmt: skip
    robot.closing.add(closure.name)
    sides = (link, np.eye(4)), (closure.link_b, closure.frame_b @ at)
    robot.closures.append(closure_of(f"{closure.name}_closure", "fixed", sides, line=closure.line))
    if forces.get("spring_stiffness"):
        rest = forces.get("spring_reference", 0.0)
        robot.springs.append(StatedSpring(closure.name, forces["spring_stiffness"], rest))


def _at_zero(closure: Closure, kind: JointKind, poses: Mapping[str, Array]) -> Array:
    """Return the motion that takes the joint's second frame onto its first where the robot is at zero."""
    ends = (closure.link_a, closure.frame_a), (closure.link_b, closure.frame_b)
    found = relative(*(poses[link] @ frame for link, frame in ends))
    if kind.slides:
        return placement_from(np.eye(3), -found[2, 3] * Z)
    angle = np.arctan2(found[1, 0] - found[0, 1], found[0, 0] + found[1, 1])
    return placement_from(rotation_from_axis_angle(Z, np.cos(angle), np.sin(-angle)), np.zeros(3))
