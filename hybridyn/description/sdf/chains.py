"""Joints of an SDF tree as joints of one axis each.

A link keeps the frame of its file. A joint whose axis does not pass through the origin of its link's frame
gets a massless link at the joint, and a fixed joint from there.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ...spatial import quaternion_from_rotation, rotation_from_axis_angle
from ..mjcf.naming import unique
from ..placement import inverse, placement_from, rotation_from_quaternion
from ..records import Array, Joint, JointKind, Link
from ..robot_file import RobotFile
from .axes import Axis
from .graph import Branch
from .joints import Stated
from .poses import Poses
from .scopes import Item

#: Largest distance at which an axis still passes through an origin, and largest part of a unit axis that is
#: rounding, relative to the coordinates: poses are products of a few matrices.
POSE_ROUNDING = 16 * np.finfo(float).eps


@dataclass(frozen=True, eq=False)
class Part:
    """One of the joints that make a joint of SDF.

    Attributes:
        name: Its name.
        kind: Its kind.
        axis: The axis whose numbers it takes, or None.
        direction: Unit vector of its axis in the world, shape (3,), or None.
        position: Its position in the posture of the file [m or rad].
    """

    name: str
    kind: JointKind
    axis: Axis | None = None
    direction: Array | None = None
    position: float = 0.0


@dataclass
class Names:
    """Names of the robot, which stay unique.

    Attributes:
        links: Taken names of links.
        joints: Taken names of joints and couplings.
        root: Name of the link of the world.
        parts: Names of the joints that a joint of SDF became, by its element.
    """

    links: set[str]
    joints: set[str]
    root: str = "world"
    parts: dict[Item, list[Part]] = field(default_factory=dict)

    def link(self, item: Item | None) -> str:
        """Return the name of a link, None for the world."""
        return self.root if item is None else item.full_name


def add_branch(robot: RobotFile, branch: Branch, poses: Poses, names: Names) -> None:
    """Add a joint of the tree to the robot, with massless links where it needs them."""
    add_chain(robot, branch, names.link(branch.below), poses, names)


def add_chain(robot: RobotFile, branch: Branch, target: str, poses: Poses, names: Names) -> None:
    """Add the joints from the link above to a link that stands where the link below stands."""
    stated, source = branch.joint, names.link(branch.above)
    line = stated.item.node.line if stated.item.node.file == robot.file else None
    parts = _parts(stated, names)
    names.parts[stated.item] = parts
    start, end = poses.world(branch.above), poses.world(branch.below)
    origin = _origin(stated, start, end)
    level = np.eye(3)
    at = inverse(start) @ end @ placement_from(level, origin)
    chain: list[Joint] = []
    for part in parts if branch.forward else reversed(parts):
        joint = _joint(part, stated, end[:3, :3], branch.forward, line)
        shift = _to_zero(part, joint, stated, branch.forward, robot)
        chain.append(replace(joint, parent=source, placement=at @ shift))
        source, at = unique(f"{target}_{part.name}", names.links), np.eye(4)
        names.links.add(source)
        chain[-1] = replace(chain[-1], child=source)
    if not chain:
        chain.append(_weld(stated.name, names.link(branch.above), target, at, line))
    elif origin.any():
        weld = unique(f"{target}_fixed", names.joints)
        names.joints.add(weld)
        chain.append(_weld(weld, source, target, placement_from(level, -origin), line))
    else:
        names.links.discard(source)
        chain[-1] = replace(chain[-1], child=target)
    robot.joints += chain
    robot.links += [Link(joint.child, 0.0, np.zeros(3), np.zeros((3, 3)), line, True) for joint in chain[:-1]]


def tidy(axis: Array) -> Array:
    """Return a unit vector without parts that are rounding, shape (3,).

    Args:
        axis: A vector of length 1 within rounding.
    """
    kept = np.where(np.abs(axis) <= POSE_ROUNDING, 0.0, axis)
    return np.sign(kept) if np.count_nonzero(kept) == 1 else kept / np.linalg.norm(kept)


def _weld(name: str, parent: str, child: str, at: Array, line: int | None) -> Joint:
    return Joint(name, "fixed", parent, child, at, np.array([1.0, 0.0, 0.0]), line=line)


def _parts(stated: Stated, names: Names) -> list[Part]:
    """Return the joints of one axis that make a joint, from its parent to its child."""
    positions = stated.position or (0.0,) * max(1, len(stated.axes))
    if stated.kind == "fixed":
        return []
    if stated.kind == "ball":
        return [Part(stated.name, "spherical")]
    if stated.kind in ("universal", "revolute2"):
        made = []
        for number, (axis, position) in enumerate(zip(stated.axes, positions, strict=True), 1):
            name = unique(f"{stated.name}_{number}", names.joints)
            names.joints.add(name)
            made.append(Part(name, "revolute", axis, axis.direction, position))
        return made
    (axis,) = stated.axes
    if stated.kind == "screw":
        slide = unique(f"{stated.name}_slide", names.joints)
        names.joints.add(slide)
        turn = Part(stated.name, "revolute", axis, axis.direction, positions[0])
        return [turn, Part(slide, "prismatic", None, axis.direction)]
    kinds: dict[str, JointKind] = {"revolute": "revolute", "continuous": "continuous"}
    return [Part(stated.name, kinds.get(stated.kind, "prismatic"), axis, axis.direction, positions[0])]


def _origin(stated: Stated, start: Array, end: Array) -> Array:
    """Return the joint's place in the frame of the link below, shape (3,); zeros where none matters."""
    if stated.kind in ("fixed", "prismatic"):
        return np.zeros(3)
    places = (start[:3, 3], end[:3, 3], stated.at[:3, 3])
    size = max(float(np.abs(place).max()) for place in places)
    origin = end[:3, :3].T @ (stated.at[:3, 3] - end[:3, 3])
    across = origin
    if stated.kind in ("revolute", "continuous", "screw"):
        axis = end[:3, :3].T @ stated.axes[0].direction
        across = origin - axis * (axis @ origin)
    return np.zeros(3) if np.abs(across).max() <= POSE_ROUNDING * size else origin


def _joint(part: Part, stated: Stated, turn: Array, forward: bool, line: int | None) -> Joint:
    """Return a joint with its numbers; links and placement are those of the caller."""
    axis = np.array([1.0, 0.0, 0.0])
    if part.direction is not None:
        axis = tidy(turn.T @ part.direction) * (1.0 if forward else -1.0)
    joint = Joint(part.name, part.kind, "", "", np.eye(4), axis, line=line)
    if part.axis is None:
        return joint
    lower, upper = part.axis.lower + part.position, part.axis.upper + part.position
    if part.kind == "continuous":
        lower, upper = -np.inf, np.inf
    return replace(
        joint, lower=lower, upper=upper, velocity=part.axis.velocity, effort=part.axis.effort,
        damping=part.axis.damping, friction=part.axis.friction, rotor_inertia=stated.rotor_inertia,
        gear_ratio=stated.gear_ratio,
    )  # fmt: skip


def _to_zero(part: Part, joint: Joint, stated: Stated, forward: bool, robot: RobotFile) -> Array:
    """Return the motion of a joint from the file's posture to position zero; record its home position."""
    if part.kind == "spherical":
        if not stated.position:
            return np.eye(4)
        x, y, z, w = stated.position
        turn = rotation_from_quaternion(x, y, z, w)
        robot.home[part.name] = (x, y, z, w) if forward else (-x, -y, -z, w)
        return placement_from(turn.T if forward else turn, np.zeros(3))
    initial = 0.0 if part.axis is None or part.axis.initial is None else part.axis.initial
    if part.position or initial:
        robot.home[part.name] = (part.position + initial,)
    if not part.position:
        return np.eye(4)
    if part.kind == "prismatic":
        return placement_from(np.eye(3), -part.position * joint.axis)
    cos, sin = np.cos(part.position), np.sin(part.position)
    return placement_from(rotation_from_axis_angle(joint.axis, np.array(cos), np.array(-sin)), np.zeros(3))


def home_pose(placement: Array) -> tuple[float, ...]:
    """Return a pose as position and quaternion x, y, z, w, shape (7,).

    Args:
        placement: The pose, shape (4, 4).
    """
    quaternion = quaternion_from_rotation(placement[:3, :3])
    return tuple(float(x) for x in (*placement[:3, 3], *quaternion))
