"""What writers share: what they receive and return, what is lost, and numbers and elements as text.

Numbers, rotations and inertias read back as the same, or to rounding.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import atan2, cos, hypot, sin
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from ..description.closure_forms import PERPENDICULAR, ROWS, words_of_rows
from ..description.names import listed, unique
from ..description.placement import angle_of
from ..description.records import (
    ON_LINKS,
    Array,
    Closure,
    Coupling,
    Description,
    Joint,
    named_by,
)
from ..description.shape_files import Shape
from ..joints.kinds import JointKind
from ..spatial import quaternion_from_rotation

#: Distance by which closures may open in a simulator that holds them with springs [m], where left out.
TIGHTNESS = 1e-4
#: Gravity of a robot whose file states none [m/s^2].
USUAL_GRAVITY = (0.0, 0.0, -9.81)
#: Limits of a joint; a speed or effort of zero is none.
LIMITS = ("lower", "upper", "speed_limit", "effort_limit")
#: Friction and rotor of a joint.
FORCES = ("damping", "friction", "rotor_inertia", "gear_ratio")
#: What becomes of a floating joint where a body that no joint holds is one.
FREED = "floating joints have the name of their link and _free, and start at the world"
#: A joint without limits, friction and rotor.
PLAIN = Joint("", JointKind.FIXED, "", "", np.eye(4), np.zeros(3))


@dataclass(frozen=True)
class ConversionRequest:
    """A robot to be written.

    Attributes:
        description: The robot.
        target: The file to be written; a writer does not write it, but may refer to other files from it.
        shapes: The visual shapes of its links; a mesh is named by its address, or by its path from the folder
            of the file to be written.
        tightness: Distance by which closures may open in a simulator that holds them with springs [m].
    """

    description: Description
    target: Path
    shapes: tuple[Shape, ...] = ()
    tightness: float = TIGHTNESS


@dataclass(frozen=True)
class Written:
    """What a writer returns.

    Attributes:
        text: The content of the file.
        notes: Remarks for the user that are no losses.
        beside: Content of the files beside it that hybridyn also reads, by their ending: ".model.toml" after
            the file's name, ".yaml" in place of its ending.
        losses: What the format cannot say, one line each, with the names of joints, links and closures. What
            hybridyn reads back from the files beside is not lost. `convert.write` adds them.
    """

    text: str
    notes: tuple[str, ...] = ()
    beside: Mapping[str, str] = field(default_factory=dict)
    losses: tuple[str, ...] = ()


class Losses:
    """Reasons in the order in which they occur, each with all names that it concerns."""

    def __init__(self) -> None:
        self._names: dict[str, dict[str, None]] = {}

    def add(self, reason: str, name: str = "") -> None:
        """Add a loss.

        Args:
            reason: What is lost and what is written in its place, in words that fit several names.
            name: Name of the joint, link or closure; "" if it concerns the whole robot.
        """
        self._names.setdefault(reason, {})[name] = None

    def lines(self) -> tuple[str, ...]:
        """Return one line for each reason: "speed limits of joints: 'elbow', 'wrist'"."""
        named = {reason: [name for name in names if name] for reason, names in self._names.items()}
        return tuple(f"{reason}: {listed(names)}" if names else reason for reason, names in named.items())


def home_of(d: Description, joint: Joint) -> tuple[float, ...]:
    """Return the home position of a joint: angles as one number, other coordinates as Pinocchio's.

    Args:
        joint: One of its joints, not fixed.
    """
    at = d.home.get(joint.name) or joint.kind.zero
    if joint.kind == "planar":
        return (*at[:2], angle_of(at[2:]))
    return at if joint.kind in ("spherical", "floating") else (angle_of(at),)


def add_of_several(
    joint: Joint, losses: Losses, limits: Sequence[str] = LIMITS, forces: Sequence[str] = FORCES
) -> None:
    """List limits and forces of a joint with several freedoms that are lost.

    Args:
        limits: Attributes of the joint, some of `LIMITS`.
        forces: Attributes of the joint, some of `FORCES`.
    """
    for what, words in (("limits", limits), ("friction and rotors", forces)):
        stated = any(getattr(joint, word) != getattr(PLAIN, word) for word in words)
        if joint.kind.nv > 1 and stated:
            losses.add(f"{what} of joints with several freedoms", joint.name)


def followers_of(
    couplings: Iterable[Coupling], losses: Losses
) -> tuple[dict[str, tuple[str, float, float]], list[Coupling]]:
    """Return couplings as `<mimic>`: one of two joints, which follows no other yet, follows the other one.

    Args:
        couplings: The couplings.
        losses: Receives their names: a `<mimic>` has that of its joint.

    Returns:
        Leader, factor and offset of each follower; and the couplings that are left.
    """
    found: dict[str, tuple[str, float, float]] = {}
    left = []
    for coupling in couplings:
        ends = (
            (coupling.terms, coupling.terms[::-1]) if len(coupling.terms) == 2 and not coupling.curve else ()
        )
        for (follower, own), (leader, other) in ends:
            if follower not in found:
                found[follower] = leader, -other / own, coupling.offset / own
                if coupling.name != follower:
                    losses.add("names of couplings, which are read back with those of joints", coupling.name)
                break
        else:
            left.append(coupling)
    return found, left


def rows_of(closure: Closure, losses: Losses) -> tuple[str, Array]:
    """Return the rows of a closure as words, and its own axes in those that the words are about.

    The words are about the axes of the closure's author, in which hybridyn reports wrenches.

    Args:
        losses: Receives a closure of which the words cannot be about the author's axes.

    Returns:
        The words, and a rotation, shape (3, 3): that of `Closure.turn`, or the identity.
    """
    order = closure.turn.argmax(axis=0)
    turn: Array = np.eye(3)[:, order]
    if closure.rotation == "perpendicular" or not np.array_equal(closure.turn, turn):
        if not np.array_equal(closure.turn, np.eye(3)):
            losses.add("axes in which hybridyn reports the wrenches of closures", closure.name)
        order, turn = np.arange(3), np.eye(3)
    own = {kind + "xyz"[i]: kind + "xyz"[axis] for kind in "tr" for i, axis in enumerate(order)}
    words = {own.get(word, word) for word in words_of_rows(closure.translations, closure.rotation)}
    return " ".join(word for word in (*ROWS, PERPENDICULAR) if word in words), turn


def allowed(d: Description, losses: Losses, words: str, change: Callable[[str], str]) -> Description:
    """Return a robot whose names a format allows: one name for one thing.

    Args:
        losses: Receives the names that are changed.
        words: The format, for the reason.
        change: Returns the name that stands for one in the format.
    """
    taken: set[str] = set()

    def named(items: Sequence[Any]) -> dict[str, str]:
        """Return a free name for the name of each item, and take it."""
        out = {}
        for item in items:
            out[item.name] = unique(change(item.name), taken)
            taken.add(out[item.name])
        return out

    joints, closures = named(d.joints), named(d.closures)
    root = {d.root: "world"} if d.root == "world" else {}
    links = named([link for link in d.links if link.name not in root]) | root
    changed = [pair for names in (links, joints, closures) for pair in names.items() if pair[0] != pair[1]]
    for old, new in changed:
        losses.add(
            f"names that {words} does not allow, or that two things have, are changed", f"{old} -> {new}"
        )
    if not changed:
        return d
    return replace(
        d,
        links=tuple(replace(link, name=links[link.name]) for link in d.links),
        joints=tuple(
            replace(j, name=joints[j.name], parent=links[j.parent], child=links[j.child]) for j in d.joints
        ),
        closures=tuple(
            replace(c, name=closures[c.name], link_a=links[c.link_a], link_b=links[c.link_b])
            for c in d.closures
        ),
        couplings=tuple(c.of(joints) for c in d.couplings),
        motors=tuple(joints[name] for name in d.motors),
        home={joints[name]: x for name, x in d.home.items()},
        effects=effects_on(d, links, {joint: (name,) for joint, name in joints.items()}),
    )


def effects_on(
    d: Description, links: Mapping[str, str], joints: Mapping[str, Sequence[str]]
) -> tuple[tuple[str, dict[str, Any]], ...]:
    """Return the effects of a robot on links and joints of other names.

    Args:
        links: New names of links; those left out keep theirs.
        joints: The joints that stand for a joint, each of which has its numbers; none if it has no more. An
            effect on none of its joints is left out.
    """
    out = []
    for effect, numbers in d.effects:
        here = {link: (name,) for link, name in links.items()} if effect in ON_LINKS else joints
        known = named_by(effect, numbers)
        left = [new for _, name in known for new in here.get(name, (name,))]
        if left or not known:
            out.append((effect, _with_names(numbers, {key for key, _ in known}, here)))
    return tuple(out)


def without_joints(d: Description, gone: Collection[str], losses: Losses) -> Description:
    """Return a robot without effects on joints that are written as others; `losses` receives their names."""
    for effect, numbers in d.effects:
        for _, name in named_by(effect, numbers):
            if name in gone and effect not in ON_LINKS:
                losses.add(f"{effect} of joints that are written as others", name)
    return replace(d, effects=effects_on(d, {}, dict.fromkeys(gone, ())))


def held_links(d: Description) -> set[str]:
    """Return the links that effects name, which have to be links of the file."""
    return {name for effect, x in d.effects if effect in ON_LINKS for _, name in named_by(effect, x)}


def _with_names(
    numbers: Mapping[str, Any], keys: Collection[str], names: Mapping[str, Sequence[str]]
) -> dict[str, Any]:
    """Return the numbers of an effect with other names; `keys`: those that hold names, as in `named_by`."""

    def renamed(key: str, value: Any) -> Any:
        """Return the value of a key."""
        if isinstance(value, str):  # the link of a payload
            return names.get(value, (value,))[0]
        if key == "ends":
            return {
                line: [new for link in links for new in names.get(link, (link,))]
                for line, links in value.items()
            }
        return {new: x for name, x in value.items() for new in names.get(name, (name,))}

    return {key: renamed(key, value) if key in keys else value for key, value in numbers.items()}


def numeral(value: float) -> str:
    """Return the shortest text that reads back as the same number; whole numbers have no point."""
    text = repr(float(value) + 0.0)  # -0.0 becomes 0.0
    return text.removesuffix(".0")


def numerals(values: Iterable[float]) -> str:
    """Return numbers with spaces between them."""
    return " ".join(numeral(value) for value in values)


def add(parent: ET.Element, tag: str, **attributes: str | float | Iterable[float] | None) -> ET.Element:
    """Add an element and return it; see `put`."""
    out = ET.SubElement(parent, tag)
    put(out, **attributes)
    return out


def put(element: ET.Element, **attributes: str | float | Iterable[float] | None) -> None:
    """Set attributes: texts, numbers that read back as the same, or none."""
    for name, value in attributes.items():
        if isinstance(value, str):
            element.set(name, value)
        elif value is not None:
            element.set(name, numerals(value if isinstance(value, Iterable) else [value]))


#: What an element holds: "@name" is an attribute, "" its text, others are children: mappings, or texts; a
#: list is several of one name. None is left out. Texts may be numbers, which read back as the same.
Content = Mapping[str, Any]


def element(tag: str, content: Content) -> ET.Element:
    """Return an element with its content."""
    out = ET.Element(tag)
    for name, stated in content.items():
        for value in stated if isinstance(stated, list) else [stated]:
            if isinstance(value, Mapping):
                out.append(element(name, value))
            elif value is not None:
                text = value if isinstance(value, str) else numerals(np.ravel(value))
                if name.startswith("@"):
                    out.set(name[1:], text)
                else:
                    (ET.SubElement(out, name) if name else out).text = text
    return out


def document(tag: str, content: Content) -> str:
    """Return the text of an XML file, whose root has a content."""
    root = element(tag, content)
    ET.indent(root)
    return f'<?xml version="1.0"?>\n{ET.tostring(root, encoding="unicode")}\n'


def angles_of(rotation: Array) -> tuple[float, float, float]:
    """Compute roll, pitch and yaw [rad], the inverse of `placement.rotation_from_rpy`.

    Roll is computed with yaw already taken away, so that the product is right to rounding near pitch = 90
    degrees, too.

    Args:
        rotation: Rotation matrix, shape (3, 3).
    """
    r = [[float(x) for x in row] for row in rotation]
    yaw = atan2(r[1][0], r[0][0])
    s, c = sin(yaw), cos(yaw)
    pitch = atan2(-r[2][0], hypot(r[0][0], r[1][0]))
    roll = atan2(s * r[0][2] - c * r[1][2], c * r[1][1] - s * r[0][1])
    return roll, pitch, yaw


def quaternion_of(rotation: Array) -> list[float]:
    """Return the quaternion w, x, y, z of a rotation matrix, shape (3, 3), with w >= 0."""
    x, y, z, w = (float(part) for part in quaternion_from_rotation(rotation))
    return [w, x, y, z]


def principal(inertia: Array) -> tuple[Array, Array]:
    """Return the principal moments of an inertia, shape (3,), and their axes as columns, shape (3, 3)."""
    if not np.any(inertia - np.diag(np.diag(inertia))):
        return np.diag(inertia).copy(), np.eye(3)
    moments, axes = np.linalg.eigh(inertia)
    return moments, -axes if np.linalg.det(axes) < 0 else axes
