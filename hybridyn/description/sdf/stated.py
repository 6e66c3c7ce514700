"""The links and joints of an SDF file as the file states them, in the world.

A link has SDFormat's defaults: without `<inertial>` it weighs 1 kg. A joint has its type, links, pose and
axes in the world, numbers and leaders.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from ...joints.kinds import JointKind
from ..closure_forms import LARGEST_COSINE
from ..joint_graph import WORLD, StatedJoint
from ..joint_words import UNIVERSAL, WORDS, called
from ..names import did_you_mean, listed
from ..records import Array, Link, massless
from ..urdf.xml_node import XmlNode
from .elements import Notes, direction, flag, numbers, pose, relative_to, screw_pitch, word
from .models import Item, SdfModels
from .shapes import inertia_of_shapes

#: The joints by type.
SDF = called("sdf")
CONTINUOUS, SCREW = WORDS[JointKind.CONTINUOUS].sdf, WORDS[JointKind.SCREW].sdf

#: How many axes each type of joint has, and a gearbox; those with fewer before others.
AXES = {
    word: count for count in (0, 1, 2) for word, joint in SDF.items()
    if sum(kind.single for kind in joint.chain) == count
} | {"gearbox": 2}  # fmt: skip

#: Types of joints that are not read, and what to write in their place.
UNREAD = {"piston": "a revolute and a prismatic joint; programs never agreed on its meaning"}

#: Limits of an endless joint, whatever it states.
ENDLESS = {"lower": -math.inf, "upper": math.inf}

#: Importance of a joint whose position something needs: a loop is cut beside it, not at it.
NEEDED = 4

#: What is noted of links and joints.
ASSUMED = "{}: no mass or inertia is stated, so SDFormat's default counts (1 kg, 1 kg m^2 about each axis)"
ENDLESS_LIMITS = "limits of position of continuous joints {} are ignored, as Gazebo and Drake do"
WORLD_LINK = (
    "links {} without <inertial> stand still where the model is, as in PyBullet; sdformat refuses links of "
    "this name"
)
WEIGHTLESS = (
    "gravity does not act on links {}: effects='model' takes their weight off (gravity_compensation); the "
    "default effects do not"
)
OTHERS = "joints {}: parts of screws or gearboxes in a joint of another type are ignored, as Gazebo does"
FORCELESS = "drops the forces of the axes of gearboxes {}; a gearbox only ties the joints of its links"
IDLE = "joints {}: an axis that the joint does not have, and its dynamics, are ignored, as Gazebo does"


def read_link(item: Item, models: SdfModels, file: str, notes: Notes) -> Link:
    """Return a link; note SDFormat's default inertia.

    Args:
        item: The element.
        models: Where everything stands.
        file: The robot's own file.
        notes: Takes what is noted.

    Raises:
        ModelError: A number is invalid, or a link states forces that hybridyn does not have.
    """
    node = item.node
    if flag(node, "kinematic"):
        raise node.error("a program moves a kinematic link; remove <kinematic>")
    decay = node.child("velocity_decay")
    if decay is not None and any(numbers(decay, "velocity_decay").values()):
        raise decay.error("damping of a link's speed is not read; set it to 0, or put damping on joints")
    inertial = node.child("inertial")
    tensor = at = None
    if inertial is not None:
        _refuse_unread(inertial)
        if inertial.flag("auto", False):
            mass, com, inertia = inertia_of_shapes(item, inertial, models)
            return Link(item.full_name, mass, com, (inertia + inertia.T) / 2, line_of(node, file))
        tensor, at = inertial.child("inertia"), inertial.child("pose")
    if stands_still(item):
        notes.setdefault(WORLD_LINK, []).append(item.full_name)
        return massless(item.full_name, line_of(node, file))
    if inertial is None or tensor is None or not word(inertial, "mass"):
        notes.setdefault(ASSUMED, []).append(item.full_name)
    ixx, ixy, ixz, iyy, iyz, izz = numbers(tensor, "inertia").values()
    placement = pose(at)
    turn = placement[:3, :3]
    inertia = turn @ np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]]) @ turn.T
    mass = numbers(inertial, "inertial")["mass"]
    return Link(item.full_name, mass, placement[:3, 3], (inertia + inertia.T) / 2, line_of(node, file))


def stands_still(item: Item) -> bool:
    """Return whether a link is part of the world: PyBullet takes one called "world" without inertia so."""
    return item.name == "world" and item.node.child("inertial") is None


def _refuse_unread(inertial: XmlNode) -> None:
    """Refuse the inertia of displaced fluid, and a pose in another frame."""
    if frame := relative_to(inertial.child("pose")):
        raise inertial.error(f"its pose is relative to '{frame}'; SDFormat has it in the link's frame")
    added = inertial.child("fluid_added_mass")
    if added is not None and any(child.number() for child in added.children() if child.content()):
        raise added.error("the inertia of displaced fluid is not read; remove it")


def line_of(node: XmlNode, file: str) -> int | None:
    """Return the line of an element in the robot's own file, None in another one."""
    return node.line if node.file == file else None


@dataclass(frozen=True, eq=False)
class Axis:
    """An axis of a joint.

    Attributes:
        direction: Unit vector in the world, shape (3,).
        numbers: Limits, friction, and a rotor of this axis where one is stated, as in `records.Joint`; the
            lower limit may be above the upper one.
        spring: Stiffness of its spring [N/m or N m/rad], and its position without force [m or rad].
        initial: Position at the start [m or rad], nan if not stated.
        mimic: The element `<mimic>`, and the joint that it follows, or None.
    """

    direction: Array
    numbers: dict[str, float]
    spring: tuple[float, float]
    initial: float
    mimic: tuple[XmlNode, Item] | None

    @property
    def rotor(self) -> bool:
        """Whether a rotor turns with it."""
        return bool(self.numbers.get("rotor_inertia"))

    @property
    def limited(self) -> bool:
        """Whether it has any limit."""
        return any(math.isfinite(self.numbers[word]) for word in ("lower", "upper", "velocity", "effort"))

    @property
    def needed(self) -> bool:
        """Whether its position matters: damping, friction, a spring, a leader or a start depends on it."""
        forces = self.numbers["damping"], self.numbers["friction"], self.spring[0]
        return any(forces) or self.rotor or self.mimic is not None or not math.isnan(self.initial)


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
        pitch: Way of a screw along its axis [m/rad], positive if right-handed.
    """

    item: Item
    kind: str
    links: tuple[Item | None, Item | None]
    at: Array
    axes: list[Axis]
    rotor: dict[str, float]
    pitch: float = 0.0

    @property
    def chain(self) -> tuple[JointKind, ...]:
        """Kinds of the joints that move, one behind the other."""
        return tuple(kind for kind in SDF[self.kind].chain if kind.nv)

    def importance(self, leaders: Collection[Item]) -> int:
        """Return how much would be lost if it were only a closure. `leaders`: joints that others follow."""
        if self.kind == "fixed":
            return NEEDED + 1
        needed = (
            not SDF[self.kind].closure
            or self.rotor["rotor_inertia"]
            or any(axis.needed for axis in self.axes)
        )
        if needed or self.item in leaders:
            return NEEDED
        if any(axis.limited for axis in self.axes):
            return 3
        return 1 if self.chain == (JointKind.SPHERICAL,) else 2


def read_joints(models: SdfModels, file: str, notes: Notes) -> tuple[list[Stated], list[Stated]]:
    """Return the joints in the order of the file, and the gearboxes, which join nothing.

    Args:
        models: Where everything stands.
        file: The robot's own file.
        notes: Takes what is noted.

    Raises:
        ModelError: The type is not read, a link or axis is missing, or a number is invalid.
    """
    every = [_read_joint(item, models, file, notes) for item in models.every("joint")]
    joints = [joint for joint in every if joint.kind != "gearbox"]
    joints += [_held(item, models, file) for item in models.every("link") if stands_still(item)]
    gearboxes = [joint for joint in every if joint.kind == "gearbox"]
    idle = [box.name for box in gearboxes if any(axis.needed or axis.limited for axis in box.axes)]
    notes.setdefault(FORCELESS, []).extend(idle)
    leaders = {axis.mimic[1] for joint in joints for axis in joint.axes if axis.mimic is not None}
    importance = {joint: joint.importance(leaders) for joint in joints}
    children, out = {WORLD}, {}
    for joint in sorted(joints, key=lambda joint: (joint.closes, -importance[joint])):
        rank = joint.closes, -importance[joint], joint.ends[1] in children
        needed = importance[joint] == NEEDED
        out[joint] = replace(joint, rank=rank, needed=needed)
        children.add(joint.ends[1])
    return [out[joint] for joint in joints], gearboxes


def _held(item: Item, models: SdfModels, file: str) -> Stated:
    """Return the joint that holds a link where it stands in the world."""
    name, ends, line = item.full_name, (WORLD, item.full_name), line_of(item.node, file)
    rotor = {"rotor_inertia": 0.0, "gear_ratio": 1.0}
    return Stated(
        f"{name}_hold",
        ends,
        (),
        line,
        False,
        False,
        item,
        "fixed",
        (None, item),
        models.pose(item),
        [],
        rotor,
    )


def _read_joint(item: Item, models: SdfModels, file: str, notes: Notes) -> Stated:
    node, kind = item.node, item.node.text("type")
    if kind in UNREAD:
        raise node.error(f"type '{kind}' is not read; write {UNREAD[kind]}")
    if kind not in AXES:
        raise node.error(f"unknown joint type '{kind}'{did_you_mean(kind, AXES)}; known: {listed(AXES)}")
    ends = [node.required_child(tag) for tag in ("parent", "child")]
    parent, child = (models.link(item.scope, end.content(), end) for end in ends)
    if parent is child:
        what = "the world" if parent is None else f"link '{parent.full_name}'"
        raise node.error(f"joins {what} to itself")
    axes = []
    for number, tag in enumerate(("axis", "axis2")):
        axis = node.child(tag)
        if number < AXES[kind]:
            if axis is None:
                raise node.error(f"<{tag}> is missing; a {kind} joint has {AXES[kind]}")
            axes.append(_read_axis(axis, item, models))
        elif axis is not None and axis.child("mimic") is not None:
            raise axis.error(f"<mimic> in an axis that a {kind} joint does not have; remove it")
        elif axis is not None:
            notes.setdefault(IDLE, []).append(item.full_name)
    if kind == UNIVERSAL and abs(axes[0].direction @ axes[1].direction) > LARGEST_COSINE:
        raise node.error("the axes of a universal joint are perpendicular; mend them, or write revolute2")
    if kind == "revolute2" and abs(axes[0].direction @ axes[1].direction) <= LARGEST_COSINE:
        kind = UNIVERSAL
    if any(node.child(tag) is not None for tag in FOREIGN if kind not in FOREIGN[tag]):
        notes.setdefault(OTHERS, []).append(item.full_name)
    if kind == CONTINUOUS and any(math.isfinite(axes[0].numbers[word]) for word in ENDLESS):
        notes.setdefault(ENDLESS_LIMITS, []).append(item.full_name)
    first, second = (WORLD if end is None else end.full_name for end in (parent, child))
    return Stated(
        item.full_name, (first, second), (), line_of(node, file), _must_close(item), False, item, kind,
        (parent, child), models.pose(item), axes, _rotor(node, kind),
        screw_pitch(node) if kind == SCREW else 0.0,
    )  # fmt: skip


#: Children of screws and gearboxes, and the types of joints that have them.
FOREIGN = {
    "thread_pitch": (SCREW,), "screw_thread_pitch": (SCREW,), "gearbox_ratio": ("gearbox",),
    "gearbox_reference_body": ("gearbox",),
}  # fmt: skip


def _must_close(item: Item) -> bool:
    """Return whether Simbody's setting asks that a joint closes a loop."""
    physics = item.node.child("physics")
    simbody = physics and physics.child("simbody")
    return simbody is not None and flag(simbody, "must_be_loop_joint")


def _rotor(node: XmlNode, kind: str) -> dict[str, float]:
    stated = numbers(node, "joint")
    inertia, ratio = stated["drake:rotor_inertia"], stated["drake:gear_ratio"]
    if inertia and AXES[kind] != 1 and kind != "fixed":
        raise node.error(
            f"<drake:rotor_inertia> of {inertia:g} kg m^2 does not say which axis of a {kind} joint the "
            "rotor turns with; write it in the <axis>, or write revolute joints"
        )
    if ratio == 0:
        raise node.error("a gear ratio of 0 moves nothing")
    return {"rotor_inertia": inertia, "gear_ratio": ratio}


#: The rotor of an axis.
ROTOR = ("drake:rotor_inertia", "drake:gear_ratio")


def _read_axis(node: XmlNode, item: Item, models: SdfModels) -> Axis:
    xyz, local, frame = node.child("xyz"), np.array([0.0, 0.0, 1.0]), ""  # SDFormat's default
    if xyz is not None:
        local, frame = direction(xyz), xyz.attrib.get("expressed_in", "").strip()
    if item.minor >= 7 and node.child("use_parent_model_frame") is not None:
        raise node.error(
            'use_parent_model_frame ended with SDFormat 1.6; write <xyz expressed_in="__model__">'
        )
    place: Item | None = item
    if frame and xyz is not None:
        place = models.resolve(item.scope, frame, xyz)
    elif flag(node, "use_parent_model_frame", default=item.minor < 5):
        place = item.scope
    mimic, forces = node.child("mimic"), numbers(node.child("dynamics"), "dynamics")
    stated = numbers(node, "axis")
    rotor = {word.partition(":")[2]: stated[word] for word in ROTOR if not math.isnan(stated[word])}
    if rotor.get("gear_ratio") == 0:
        raise node.error("a gear ratio of 0 moves nothing")
    return Axis(
        models.pose(place)[:3, :3] @ local,
        _limits(node.child("limit")) | {word: forces[word] for word in ("damping", "friction")} | rotor,
        (forces["spring_stiffness"], forces["spring_reference"]), stated["initial_position"],
        None if mimic is None else (mimic, _leader(mimic, item, models)),
    )  # fmt: skip


def _limits(node: XmlNode | None) -> dict[str, float]:
    """Return position, speed and effort limits; negative speed and effort limits mean none in SDFormat."""
    stated = numbers(node, "limit")
    out = {tag: math.inf if stated[tag] < 0 else stated[tag] for tag in ("velocity", "effort")}
    return out | {tag: stated[tag] for tag in ("lower", "upper")}


def _leader(mimic: XmlNode, item: Item, models: SdfModels) -> Item:
    """Return the joint that an axis follows."""
    name = mimic.text("joint")
    leader = models.find(item.scope, name).get("joint")
    if leader is None:
        known = [joint.name for joint in models.every("joint") if joint.scope is item.scope]
        raise mimic.error(f"unknown joint '{name}'{did_you_mean(name, known)}; known: {listed(known)}")
    return leader
