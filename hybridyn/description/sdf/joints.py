"""Joints as an SDF file states them: type, links, pose and axes in the world, numbers, leaders."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, field, replace

import numpy as np

from ..closure_forms import LARGEST_COSINE
from ..joint_graph import WORLD, StatedJoint
from ..names import did_you_mean, listed
from ..records import Array
from ..urdf.xml_node import Node
from . import fields
from .models import Item, Models

#: How many axes each type of joint has.
AXES = {
    "fixed": 0, "ball": 0, "revolute": 1, "continuous": 1, "prismatic": 1, "universal": 2, "revolute2": 2,
}  # fmt: skip

#: Types of joints that are not read, and what to write in their place.
UNREAD = {
    "screw": "a revolute and a prismatic joint, and <mimic> in one of them",
    "gearbox": "<mimic> in the axis of one of its joints",
    "piston": "a revolute and a prismatic joint; programs never agreed on its meaning",
}

#: Importance of a joint whose position something needs: a loop is cut beside it, not at it.
NEEDED = 4

#: What is noted of joints, each once for all of them.
STOPS = "stiffness and dissipation of joint stops are not read (the effect stop has them)"
ENGINES = "settings of a physics engine are not read"
IDLE = "an axis that the joint does not have, and its dynamics, are ignored, as Gazebo does"


@dataclass(frozen=True)
class Mimic:
    """The leader that an axis follows: follower = multiplier leader + offset.

    Attributes:
        node: The element.
        joint: The leading joint.
        number: Which of its axes leads, from 0.
        multiplier: Ratio.
        offset: Position of the follower where the leader is at zero [m or rad].
    """

    node: Node
    joint: Item
    number: int
    multiplier: float
    offset: float


@dataclass(frozen=True, eq=False)
class Axis:
    """An axis of a joint.

    Attributes:
        direction: Unit vector in the world, shape (3,).
        numbers: Limits and friction, as in `records.Joint`; the lower limit may be above the upper one.
        stiffness: Stiffness of its spring [N/m or N m/rad].
        rest: Position of the spring without force [m or rad].
        initial: Position at the start [m or rad], None if not stated.
        mimic: The leader that it follows, or None.
    """

    direction: Array
    numbers: dict[str, float]
    stiffness: float
    rest: float
    initial: float | None
    mimic: Mimic | None

    @property
    def limited(self) -> bool:
        """Whether it has any limit."""
        return bool(
            np.isfinite([self.numbers[word] for word in ("lower", "upper", "velocity", "effort")]).any()
        )

    @property
    def needed(self) -> bool:
        """Whether its position matters: damping, friction, a spring, a leader or a start depends on it."""
        forces = self.numbers["damping"], self.numbers["friction"], self.stiffness
        return any(forces) or self.mimic is not None or self.initial is not None


@dataclass(frozen=True, eq=False)
class Stated(StatedJoint):
    """A joint as its file states it.

    Attributes:
        item: The element.
        kind: Its type.
        links: Parent and child link, None for the world.
        at: Pose of the joint in the world, shape (4, 4).
        axes: Its axes.
        rotor: Rotor inertia [kg m^2] and gear ratio, as in `records.Joint`.
    """

    item: Item
    kind: str
    links: tuple[Item | None, Item | None]
    at: Array
    axes: tuple[Axis, ...]
    rotor: dict[str, float]


@dataclass
class Remarks:
    """What the reader of joints notes: the joints by what is said of them."""

    joints: dict[str, list[str]] = field(default_factory=dict)

    def add(self, remark: str, item: Item) -> None:
        """Add a joint."""
        self.joints.setdefault(remark, []).append(item.full_name)

    def notes(self) -> list[str]:
        """Return the remarks in words."""
        return [f"joints {listed(names)}: {remark}" for remark, names in self.joints.items()]


def read_joints(models: Models, file: str, remarks: Remarks) -> list[Stated]:
    """Return the joints in the order of the file.

    Args:
        models: Where everything stands.
        file: The robot's own file.
        remarks: Takes what is noted.

    Raises:
        ModelError: The type is not read, a link or axis is missing, or a number is invalid.
    """
    joints = [_read_joint(item, models, file, remarks) for item in models.every("joint")]
    leaders = {axis.mimic.joint for joint in joints for axis in joint.axes if axis.mimic is not None}
    importance = {joint.item: _importance(joint, leaders) for joint in joints}
    children, out = {WORLD}, {}
    for joint in sorted(joints, key=lambda joint: (joint.closes, -importance[joint.item])):
        weight = importance[joint.item]
        rank = joint.closes, -weight, joint.ends[1] in children
        needed = weight == NEEDED or joint.kind == "revolute2"
        out[joint.item] = replace(joint, rank=rank, needed=needed)
        children.add(joint.ends[1])
    return [out[joint.item] for joint in joints]


def _importance(joint: Stated, leaders: Collection[Item]) -> int:
    """Return how much would be lost if a joint were only a closure."""
    if joint.kind == "fixed":
        return NEEDED + 1
    if joint.rotor["rotor_inertia"] or joint.item in leaders or any(axis.needed for axis in joint.axes):
        return NEEDED
    if any(axis.limited for axis in joint.axes):
        return 3
    return 1 if joint.kind == "ball" else 2


def _read_joint(item: Item, models: Models, file: str, remarks: Remarks) -> Stated:
    node, kind = item.node, _kind(item.node)
    ends = [node.required_child(tag) for tag in ("parent", "child")]
    parent, child = (models.link(item.scope, end.content(), end) for end in ends)
    if parent is child:
        what = "the world" if parent is None else f"link '{parent.full_name}'"
        raise node.error(f"joins {what} to itself")
    axes, count = [], AXES[kind]
    for number, tag in enumerate(("axis", "axis2")):
        axis = node.child(tag)
        if number < count and axis is None:
            raise node.error(f"<{tag}> is missing; a {kind} joint has {count}")
        if number < count and axis is not None:
            axes.append(_read_axis(axis, item, models, remarks))
        elif axis is not None and axis.child("mimic") is not None:
            raise axis.error(f"<mimic> in an axis that a {kind} joint does not have; remove it")
        elif axis is not None and item.full_name not in remarks.joints.get(IDLE, ()):
            remarks.add(IDLE, item)
    if kind == "universal" and abs(axes[0].direction @ axes[1].direction) > LARGEST_COSINE:
        raise node.error("the axes of a universal joint are perpendicular; mend them, or write revolute2")
    first, second = (WORLD if end is None else end.full_name for end in (parent, child))
    line = node.line if node.file == file else None
    return Stated(
        item.full_name, (first, second), (), line, _must_close(node, item, remarks), False, item, kind,
        (parent, child), models.pose(item), tuple(axes), _rotor(node, kind),
    )  # fmt: skip


def _kind(node: Node) -> str:
    kind = node.text("type")
    if kind in AXES:
        return kind
    if kind in UNREAD:
        raise node.error(f"type '{kind}' is not read; write {UNREAD[kind]}")
    raise node.error(f"unknown joint type '{kind}'{did_you_mean(kind, AXES)}; known: {listed(AXES)}")


def _must_close(node: Node, item: Item, remarks: Remarks) -> bool:
    """Return whether Simbody's setting asks that a joint closes a loop; note settings of other engines."""
    physics = node.child("physics")
    if physics is None:
        return False
    simbody = physics.child("simbody")
    if any(child.tag not in ("simbody", "provide_feedback") for child in physics.children()):
        remarks.add(ENGINES, item)
    return simbody is not None and fields.flag(simbody, "must_be_loop_joint")


def _rotor(node: Node, kind: str) -> dict[str, float]:
    inertia = fields.number(node, "drake:rotor_inertia")
    ratio = fields.number(node, "drake:gear_ratio", 1.0)
    if inertia < 0:
        raise node.error(f"negative rotor inertia {inertia:g}")
    if inertia and kind in ("ball", "universal", "revolute2"):
        raise node.error(
            f"<drake:rotor_inertia> of {inertia:g} kg m^2 does not say which axis of a {kind} joint the "
            "rotor turns with; write revolute joints, with the rotor in one of them"
        )
    if ratio == 0:
        raise node.error("a gear ratio of 0 moves nothing")
    return {"rotor_inertia": inertia, "gear_ratio": ratio}


def _read_axis(node: Node, item: Item, models: Models, remarks: Remarks) -> Axis:
    xyz = node.child("xyz")
    if xyz is None:
        raise node.error("<xyz> is missing; give a direction such as <xyz>0 0 1</xyz>")
    local = fields.direction(xyz)
    frame = str(xyz.xml.get("expressed_in", "")).strip()
    if item.minor >= 7 and node.child("use_parent_model_frame") is not None:
        raise node.error(
            'use_parent_model_frame ended with SDFormat 1.6; write <xyz expressed_in="__model__">'
        )
    place: Item | None = item
    if frame:
        place = models.resolve(item.scope, frame, xyz)
    elif fields.flag(node, "use_parent_model_frame", default=item.minor < 5):
        place = item.scope
    dynamics = node.child("dynamics")
    forces = {tag: fields.number(dynamics, tag) for tag in ("damping", "friction", "spring_stiffness")}
    for tag, value in forces.items():
        if dynamics is not None and value < 0:
            raise dynamics.error(f"negative {tag} {value:g}")
    stiffness = forces.pop("spring_stiffness")
    start = fields.word(node, "initial_position")
    return Axis(
        models.pose(place)[:3, :3] @ local, _limits(node.child("limit"), item, remarks) | forces, stiffness,
        fields.number(dynamics, "spring_reference"),
        fields.number(node, "initial_position") if start else None, _mimic(node, item, models),
    )  # fmt: skip


def _limits(node: Node | None, item: Item, remarks: Remarks) -> dict[str, float]:
    """Return position, speed and effort limits; negative speed and effort limits mean none in SDFormat."""
    out = {}
    for tag, none in (("lower", -math.inf), ("upper", math.inf)):
        value = fields.number(node, tag, none, infinite=True)
        out[tag] = math.copysign(math.inf, value) if abs(value) >= fields.UNLIMITED else value
    for tag in ("velocity", "effort"):
        value = fields.number(node, tag, math.inf, infinite=True)
        out[tag] = value if 0 <= value < fields.UNLIMITED else math.inf
    stops = [tag for tag in ("stiffness", "dissipation") if node is not None and node.child(tag) is not None]
    for tag in stops:
        fields.number(node, tag)
    if stops:
        remarks.add(STOPS, item)
    return out


def _mimic(node: Node, item: Item, models: Models) -> Mimic | None:
    mimic = node.child("mimic")
    if mimic is None:
        return None
    name = mimic.text("joint")
    leader = models.find(item.scope, name).get("joint")
    if leader is None:
        known = [joint.name for joint in models.every("joint") if joint.scope is item.scope]
        raise mimic.error(f"unknown joint '{name}'{did_you_mean(name, known)}; known: {listed(known)}")
    which = str(mimic.xml.get("axis", "")).strip() or "axis"
    if which not in ("axis", "axis2"):
        raise mimic.error(f"axis '{which}' instead of 'axis' or 'axis2'")
    ratio = fields.number(mimic, "multiplier", 1.0)
    offset = fields.number(mimic, "offset") - ratio * fields.number(mimic, "reference")
    return Mimic(mimic, leader, int(which == "axis2"), ratio, offset)
