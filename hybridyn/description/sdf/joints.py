"""Joints as an SDF file states them: type, links, pose and axes in the world."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..closure_forms import LARGEST_COSINE
from ..names import did_you_mean, listed
from ..records import Array
from ..urdf.xml_node import Node
from . import fields
from .axes import Axis, Remarks, read_axis, refuse_idle
from .poses import Poses
from .scopes import Item

#: How many axes each type of joint has.
AXES = {
    "fixed": 0, "ball": 0, "revolute": 1, "continuous": 1, "prismatic": 1, "screw": 1, "universal": 2,
    "revolute2": 2, "gearbox": 2,
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Stated:
    """A joint as its file states it.

    Attributes:
        item: The element.
        kind: Its type.
        parent: Parent link, None for the world.
        child: Child link, None for the world.
        at: Pose of the joint in the world, shape (4, 4).
        cut: Whether the file asks that it closes a loop.
        pitch: Way of a screw along its axis [m/rad].
        position: Position of the joint in the posture of the file, () for zero.
        frame_a: Pose of the joint in the parent's frame where the file states it, shape (4, 4), or None.
        rotor_inertia: Inertia of the motor's rotor [kg m^2].
        gear_ratio: Rotor turns per joint turn.
    """

    item: Item
    kind: str
    parent: Item | None
    child: Item | None
    at: Array
    axes: tuple[Axis, ...] = ()
    cut: bool = False
    pitch: float = 0.0
    position: tuple[float, ...] = ()
    frame_a: Array | None = None
    rotor_inertia: float = 0.0
    gear_ratio: float = 1.0

    @property
    def name(self) -> str:
        """Name of the joint, with those of nested models."""
        return self.item.full_name


def read_joint(item: Item, poses: Poses, remarks: Remarks) -> Stated:
    """Return a joint as its file states it.

    Raises:
        ModelError: The type is not read, a link or axis is missing, or a number is invalid.
    """
    node = item.node
    kind = _kind(node)
    parent, child = (_end(node, tag, item, poses) for tag in ("parent", "child"))
    if parent is child:
        what = "the world" if parent is None else f"link '{parent.full_name}'"
        raise node.error(f"joins {what} to itself")
    written = [node.child(tag) for tag in ("axis", "axis2")]
    axes: list[Axis] = []
    for number in range(AXES[kind]):
        axis = written[number]
        if axis is None:
            raise node.error(f"<{('axis', 'axis2')[number]}> is missing; a {kind} joint has {AXES[kind]}")
        axes.append(read_axis(axis, item, poses, remarks))
    if any(axis is not None for axis in written[AXES[kind] :]):
        refuse_idle(kind, [axis for axis in written[AXES[kind] :] if axis is not None], item, remarks)
    if kind == "universal" and abs(axes[0].direction @ axes[1].direction) > LARGEST_COSINE:
        raise node.error("the axes of a universal joint are perpendicular; mend them, or write revolute2")
    return Stated(
        item, kind, parent, child, poses.world(item), tuple(axes),
        cut=_must_close(node, item, remarks),
        pitch=_pitch(node) if kind == "screw" else 0.0,
        position=_position(node, kind),
        frame_a=_frame_a(node),
        rotor_inertia=_rotor_inertia(node, kind),
        gear_ratio=fields.number(node, "drake:gear_ratio", 1.0),
    )  # fmt: skip


def _kind(node: Node) -> str:
    kind = node.text("type")
    if kind in AXES:
        return kind
    if kind == "piston":
        raise node.error(
            "type 'piston' never had a meaning that programs agree on; write a revolute and a prismatic joint"
        )
    raise node.error(f"unknown joint type '{kind}'{did_you_mean(kind, AXES)}; known: {listed(AXES)}")


def _end(node: Node, tag: str, item: Item, poses: Poses) -> Item | None:
    """Return the parent or child link of a joint, None for the world."""
    end = node.required_child(tag)
    name = end.content()
    return poses.link(item.scope, name, end)


def _must_close(node: Node, item: Item, remarks: Remarks) -> bool:
    """Return whether Simbody's setting asks that a joint closes a loop; note settings of other engines."""
    physics = node.child("physics")
    if physics is None:
        return False
    simbody = physics.child("simbody")
    if any(child.tag not in ("simbody", "provide_feedback") for child in physics.children()):
        remarks.engines.append(item.full_name)
    return simbody is not None and fields.flag(simbody, "must_be_loop_joint")


def _pitch(node: Node) -> float:
    """Return the way of a screw along its axis [m/rad], positive for a right-handed thread."""
    newer, older = node.child("screw_thread_pitch"), node.child("thread_pitch")
    if newer is not None:
        pitch = newer.content_number() / (2 * math.pi)
    elif older is not None and (rate := older.content_number()):
        pitch = -1 / rate
    else:
        raise node.error("a screw needs <screw_thread_pitch> [m per turn], positive if right-handed")
    if pitch == 0 or abs(pitch) > 1e50:
        raise node.error("the pitch of a screw is neither zero nor infinite; write a revolute joint instead")
    return pitch


def _position(node: Node, kind: str) -> tuple[float, ...]:
    """Return the position that hybridyn's own element states, () if it is absent."""
    stated = node.child("hybridyn:position")
    if stated is None:
        return ()
    count = {"ball": 4, "fixed": 0}.get(kind, AXES[kind])
    numbers = stated.content_numbers(count)
    if kind == "ball":
        norm = float(np.linalg.norm(numbers))
        if abs(norm - 1) > fields.QUATERNION_SLACK:
            raise stated.error(f"its quaternion has length {norm:g}; a unit quaternion is needed")
        numbers = numbers / norm
    return tuple(float(x) for x in numbers)


def _frame_a(node: Node) -> Array | None:
    stated = node.child("hybridyn:parent_pose")
    return None if stated is None else fields.pose(stated)


def _rotor_inertia(node: Node, kind: str) -> float:
    inertia = fields.number(node, "drake:rotor_inertia")
    if inertia < 0:
        raise node.error(f"negative rotor inertia {inertia:g}")
    if inertia and kind in ("ball", "universal", "revolute2"):
        raise node.error(
            f"<drake:rotor_inertia> of {inertia:g} kg m^2 does not say which axis of a {kind} joint the "
            "rotor turns with; write revolute joints, with the rotor in one of them"
        )
    if fields.number(node, "drake:gear_ratio", 1.0) == 0:
        raise node.error("a gear ratio of 0 moves nothing")
    return inertia
