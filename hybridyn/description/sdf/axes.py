"""Axes of joints as an SDF file states them: direction in the world, limits, forces, and the leader."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from ..names import did_you_mean, listed
from ..records import Array
from ..urdf.xml_node import Node
from . import fields
from .poses import Poses
from .scopes import Item


@dataclass(frozen=True)
class Mimic:
    """The leader that an axis follows: follower = multiplier (leader - reference) + offset.

    Attributes:
        joint: The leading joint.
        second: Whether its second axis leads.
        multiplier: Ratio.
        offset: Position of the follower at the reference [m or rad].
        reference: Position of the leader [m or rad].
        node: The element.
    """

    joint: Item
    second: bool
    multiplier: float
    offset: float
    reference: float
    node: Node


@dataclass(frozen=True, eq=False)
class Axis:
    """An axis of a joint.

    Attributes:
        direction: Unit vector in the world, shape (3,).
        lower: Lower limit [m or rad], -inf if absent; the file may state it above the upper.
        upper: Upper limit [m or rad], +inf if absent.
        velocity: Speed limit [m/s or rad/s], +inf if absent.
        effort: Effort limit [N or N m], +inf if absent.
        damping: Viscous friction [N s/m or N m s/rad].
        friction: Dry friction [N or N m].
        stiffness: Stiffness of its spring [N/m or N m/rad].
        rest: Position of the spring without force [m or rad].
        initial: Position at the start [m or rad], None if not stated.
        mimic: The leader that it follows, or None.
    """

    direction: Array
    lower: float = -math.inf
    upper: float = math.inf
    velocity: float = math.inf
    effort: float = math.inf
    damping: float = 0.0
    friction: float = 0.0
    stiffness: float = 0.0
    rest: float = 0.0
    initial: float | None = None
    mimic: Mimic | None = None

    @property
    def limited(self) -> bool:
        """Whether it has any limit."""
        return not np.isinf([self.lower, self.upper, self.velocity, self.effort]).all()

    @property
    def forceful(self) -> bool:
        """Whether damping, friction or a spring acts on it."""
        return any((self.damping, self.friction, self.stiffness))


@dataclass
class Remarks:
    """What the reader of joints notes, each said once for all joints.

    Attributes:
        stops: Joints with stiffness or dissipation of their stops.
        engines: Joints with settings of a physics engine.
        idle: Joints whose `<axis>` has no meaning.
    """

    stops: list[str] = field(default_factory=list)
    engines: list[str] = field(default_factory=list)
    idle: list[str] = field(default_factory=list)

    def notes(self) -> list[str]:
        """Return the remarks in words."""
        words = {
            "stiffness and dissipation of joint stops are not read (the effect stop has them)": self.stops,
            "settings of a physics engine are not read": self.engines,
            "an axis that the joint does not have, and its dynamics, are ignored, as Gazebo does": self.idle,
        }
        return [f"joints {listed(names)}: {text}" for text, names in words.items() if names]


def read_axis(node: Node, item: Item, poses: Poses, remarks: Remarks) -> Axis:
    """Return an axis of a joint.

    Args:
        node: The element `<axis>` or `<axis2>`.
        poses: Where everything stands.
        remarks: Takes what is noted.

    Raises:
        ModelError: The direction is missing or zero, a frame is unknown, or a number is invalid.
    """
    xyz = node.child("xyz")
    if xyz is None:
        raise node.error("<xyz> is missing; give a direction such as <xyz>0 0 1</xyz>")
    local = fields.direction(xyz)
    frame = str(xyz.xml.get("expressed_in", "")).strip()
    minor = item.scope.source.minor
    in_model = fields.flag(node, "use_parent_model_frame", default=minor < 5)
    if minor >= 7 and node.child("use_parent_model_frame") is not None:
        raise node.error(
            'use_parent_model_frame ended with SDFormat 1.6; write <xyz expressed_in="__model__">'
        )
    if frame:
        turn = poses.named(item.scope, frame, xyz)
    else:
        turn = poses.of_scope(item.scope) if in_model else poses.world(item)
    values = {
        **_limits(node.child("limit"), item, remarks), **_dynamics(node.child("dynamics")),
        "initial": fields.number(node, "initial_position") if node.child("initial_position") else None,
        "mimic": _mimic(node, item),
    }  # fmt: skip
    return Axis(turn[:3, :3] @ local, **values)  # type: ignore[arg-type]


def _limits(node: Node | None, item: Item, remarks: Remarks) -> dict[str, float]:
    """Return position, speed and effort limits; negative speed and effort limits mean none in SDFormat."""
    lower = fields.number(node, "lower", -math.inf, infinite=True)
    upper = fields.number(node, "upper", math.inf, infinite=True)
    lower, upper = (math.copysign(math.inf, x) if fields.unlimited(x) else x for x in (lower, upper))
    most = {}
    for tag in ("velocity", "effort"):
        value = fields.number(node, tag, math.inf, infinite=True)
        most[tag] = value if 0 <= value < fields.UNLIMITED else math.inf
    if node is not None and (node.child("stiffness") or node.child("dissipation")):
        for tag in ("stiffness", "dissipation"):
            fields.number(node, tag)
        remarks.stops.append(item.full_name)
    return {"lower": lower, "upper": upper, **most}


def _dynamics(node: Node | None) -> dict[str, float]:
    names = {
        "damping": "damping", "friction": "friction", "stiffness": "spring_stiffness",
        "rest": "spring_reference",
    }  # fmt: skip
    out = {name: fields.number(node, tag) for name, tag in names.items()}
    for name in ("damping", "friction", "stiffness"):
        if node is not None and out[name] < 0:
            raise node.error(f"negative {names[name]} {out[name]:g}")
    return out


def _mimic(node: Node, item: Item) -> Mimic | None:
    mimic = node.child("mimic")
    if mimic is None:
        return None
    name = mimic.text("joint")
    found = [other for other in item.scope.find(name) if other.kind == "joint"]
    if not found:
        known = item.scope.items["joint"]
        raise mimic.error(f"unknown joint '{name}'{did_you_mean(name, known)}; known: {listed(known)}")
    which = str(mimic.xml.get("axis", "")).strip() or "axis"
    if which not in ("axis", "axis2"):
        raise mimic.error(f"axis '{which}' instead of 'axis' or 'axis2'")
    return Mimic(
        found[0], which == "axis2", fields.number(mimic, "multiplier", 1.0), fields.number(mimic, "offset"),
        fields.number(mimic, "reference"), mimic,
    )  # fmt: skip


def refuse_idle(kind: str, idle: list[Node], item: Item, remarks: Remarks) -> None:
    """Note axes without a meaning, with their damping, friction and springs, which Gazebo ignores, too.

    Args:
        kind: Type of the joint.
        idle: The axes that a joint of this type does not have.
        remarks: Takes the note.

    Raises:
        ModelError: Such an axis has a leader.
    """
    for axis in idle:
        if axis.child("mimic") is not None:
            raise axis.error(f"<mimic> in an axis that a {kind} joint does not have; remove it")
    remarks.idle.append(item.full_name)
