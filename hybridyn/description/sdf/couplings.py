"""Couplings of an SDF file: screws, `<mimic>` and gearboxes."""

from __future__ import annotations

import numpy as np

from ..records import Array, Coupling
from ..robot_file import RobotFile
from ..urdf.xml_node import Node
from .axes import Mimic
from .chains import Names, Part
from .graph import Branch
from .joints import Stated
from .poses import Poses
from .scopes import Item

#: Largest sine between axes that are parallel: files keep 5 or 6 digits.
PARALLEL = 1e-5

#: Sum of joint positions: coefficients by joint, and a constant.
Sum = tuple[dict[str, float], float]


def add_couplings(
    robot: RobotFile, joints: list[Stated], branches: list[Branch], poses: Poses, names: Names
) -> None:
    """Add the couplings of every joint to the robot.

    Raises:
        ModelError: A leader has no such axis, or a gearbox turns what no sum of joint angles measures.
    """
    above = {branch.below: branch for branch in branches}
    for stated in joints:
        line = stated.item.node.line if stated.item.node.file == robot.file else None
        if stated.kind == "gearbox":
            terms, constant = _gearbox(stated, above, poses, names)
            robot.couplings.append(Coupling(stated.name, tuple(terms.items()), -constant, line))
            continue
        parts = names.parts.get(stated.item, [])
        if stated.kind == "screw":
            turn, slide = parts
            terms = {slide.name: 1.0, turn.name: -stated.pitch}
            offset = -stated.pitch * turn.position
            robot.couplings.append(Coupling(slide.name, tuple(terms.items()), offset, line))
        for number, axis in enumerate(stated.axes):
            if axis.mimic is not None:
                robot.couplings.append(_mimic(parts[number], axis.mimic, names, line))


def reference_body(stated: Stated, poses: Poses) -> Item | None:
    """Return the link against which a gearbox measures its angles, None for the world.

    Raises:
        ModelError: It is not stated, or unknown.
    """
    node = stated.item.node.required_child("gearbox_reference_body")
    return poses.link(stated.item.scope, node.content(), node)


def _mimic(follower: Part, mimic: Mimic, names: Names, line: int | None) -> Coupling:
    """Return follower - multiplier leader = offset - multiplier reference, in positions of hybridyn."""
    parts = names.parts.get(mimic.joint, [])
    number = 1 if mimic.second else 0
    has_two = mimic.joint.node.text("type") in ("universal", "revolute2")
    if number >= len(parts) or (number and not has_two) or parts[number].axis is None:
        which = "second axis" if number else "axis"
        raise mimic.node.error(f"joint '{mimic.joint.full_name}' has no {which} that could lead")
    leader = parts[number]
    if leader.name == follower.name:
        raise mimic.node.error("a joint cannot follow itself")
    offset = mimic.offset - mimic.multiplier * (mimic.reference + leader.position) + follower.position
    terms = ((follower.name, 1.0), (leader.name, -mimic.multiplier))
    return Coupling(follower.name, terms, offset, line)


def _gearbox(stated: Stated, above: dict[Item | None, Branch], poses: Poses, names: Names) -> Sum:
    """Return theta_2 + ratio theta_1, the angles of child and parent link against the reference body."""
    node, body = stated.item.node, reference_body(stated, poses)
    ratio_node = node.child("gearbox_ratio")
    ratio = 1.0 if ratio_node is None else ratio_node.content_number()
    total: dict[str, float] = {}
    constant = 0.0
    for end, axis, weight in (
        (stated.child, stated.axes[1].direction, 1.0), (stated.parent, stated.axes[0].direction, ratio),
    ):  # fmt: skip
        angles, shift = _angle(node, body, end, axis, above, names)
        constant += weight * shift
        for joint, coefficient in angles.items():
            total[joint] = total.get(joint, 0.0) + weight * coefficient
    total = {joint: coefficient for joint, coefficient in total.items() if coefficient}
    if not total:
        raise node.error("the gearbox couples nothing; check its links and its ratio")
    return total, constant


def _angle(
    node: Node,
    start: Item | None,
    end: Item | None,
    axis: Array,
    above: dict[Item | None, Branch],
    names: Names,
) -> Sum:
    """Return the angle from one link to another about an axis, as a sum of joint positions."""
    up, down = _path(start, above), _path(end, above)
    while up and down and up[-1] is down[-1]:
        up.pop()
        down.pop()
    out: dict[str, float] = {}
    constant = 0.0
    for branches, toward in ((up, -1.0), (down, 1.0)):
        for branch in branches:
            for part in names.parts.get(branch.joint.item, []):
                sense = toward * (1.0 if branch.forward else -1.0)
                direction = part.direction
                if (
                    direction is None
                    or part.kind not in ("revolute", "continuous")
                    or (np.linalg.norm(np.cross(direction, axis)) > PARALLEL)
                ):
                    raise node.error(
                        f"joint '{part.name}' lies between the gearbox's reference body and its links, and "
                        "does not turn about the gearbox's axis; the angle is no sum of joint angles"
                    )
                coefficient = sense * float(np.sign(direction @ axis))
                out[part.name] = out.get(part.name, 0.0) + coefficient
                constant -= coefficient * part.position
    return out, constant


def _path(link: Item | None, above: dict[Item | None, Branch]) -> list[Branch]:
    """Return the joints from a link up to its root."""
    out = []
    while link in above:
        out.append(above[link])
        link = out[-1].above
    return out
