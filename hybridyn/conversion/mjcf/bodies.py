"""Write links and joints as nested bodies.

A massless link that only carries one joint has no body: its joint stands in the body of the next link, before
that link's own, as MuJoCo writes universal joints.

Bodies stand where hinges and slides are at home and all other joints at zero: that is MuJoCo's `qpos0`, where
it weighs equalities, and home is `ref`. Positions and axes of joints are in the frame of their body there.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass, field, replace
from typing import NamedTuple
from xml.etree import ElementTree as ET

import numpy as np

from ...description.placement import inverse
from ...description.poses import motion_of
from ...description.records import Array, Description, Joint, JointKind
from ...description.robot_file import ZERO
from ..home import home_of
from ..numerals import numeral, numerals, quaternion_of
from ..request import Losses
from .followers import FOLLOWER, Follower
from .inertias import Inertias, add_inertial

#: Name of MuJoCo's own body, which does not move.
WORLD = "world"
AXES = np.eye(3)
#: Kinds of joints with one freedom.
SINGLE = ("revolute", "continuous", "prismatic")
#: Endings of the joints of MuJoCo that stand for a joint, by its kind.
PARTS: dict[JointKind, tuple[str, ...]] = {
    "spherical": ("",),
    "planar": ("_x", "_y", "_turn"),
    "floating": ("_x", "_y", "_z", "_turn"),
}


@dataclass(eq=False)
class Tree:
    """The bodies as they are written.

    Attributes:
        worldbody: The element of the world.
        bodies: Element of each link that has a body, by the link's name.
        joints: Elements of the joints with one freedom, by the joint's name.
        balls: Elements of the joints that turn about three axes.
        qpos: Home positions of all joints, in MuJoCo's order.
        ends: Frame of each follower's end of its closure in the follower's body, shapes (4, 4).
        refs: Positions at `qpos0` of the joints with one freedom, by name [m or rad].
    """

    worldbody: ET.Element
    bodies: dict[str, ET.Element] = field(default_factory=dict)
    joints: dict[str, ET.Element] = field(default_factory=dict)
    balls: dict[str, ET.Element] = field(default_factory=dict)
    qpos: list[float] = field(default_factory=list)
    ends: dict[str, Array] = field(default_factory=dict)
    refs: dict[str, float] = field(default_factory=dict)


class _Carried(NamedTuple):
    """A joint whose body is still to come, and the body's frame at `qpos0` in the joint's frame."""

    joint: Joint
    frame: Array


class Builder:
    """Builds the tree of bodies.

    Args:
        d: The robot.
        inertias: Inertias of its links, less the shares of followers.
        followers: Bodies that follow links.
        ends: Links that have no body, because they only end a closure.
        losses: Receives what is changed.
    """

    def __init__(
        self,
        d: Description,
        inertias: Inertias,
        followers: Iterable[Follower],
        ends: Collection[str],
        losses: Losses,
    ) -> None:
        self._d, self._inertias, self._losses, self._ends = d, inertias, losses, ends
        self._children: dict[str, list[Joint]] = {}
        for joint in d.joints:
            self._children.setdefault(joint.parent, []).append(joint)
        self._followers: dict[str, list[Follower]] = {}
        for follower in followers:
            self._followers.setdefault(follower.on, []).append(follower)
        self._closed = {end for c in d.closures for end in (c.link_a, c.link_b)}
        self.tree = Tree(ET.Element("worldbody"))

    def build(self) -> Tree:
        """Return the tree of all bodies."""
        root, world = self._d.root, self.tree.worldbody
        if self._d.base == "floating":
            element = ET.SubElement(world, "body", name=self._named(root))
            ET.SubElement(element, "freejoint", name=f"{root}:free")
            x = self._d.base_home or ZERO["floating"]
            self.tree.qpos += [*x[:3], x[6], *x[3:6]]
            add_inertial(element, self._inertias.links[root], self._inertias, True, self._losses)
        elif root == WORLD:
            element = world
            if self._inertias.links[root].mass or self._inertias.links[root].inertia.any():
                self._losses.add("mass and inertia of the world's link, which do not move", root)
        else:
            element = ET.SubElement(world, "body", name=root)
            add_inertial(element, self._inertias.links[root], self._inertias, False, self._losses)
        self.tree.bodies[root] = element
        todo: list[tuple[ET.Element, Joint, Array, tuple[_Carried, ...]]]
        below = sorted(self._below(root, element), key=lambda joint: joint.kind == "floating")
        todo = [(element, joint, np.eye(4), ()) for joint in reversed(below)]
        while todo:  # depth first, which is the order of MuJoCo's qpos
            element, joint, M, carried = todo.pop()
            step = joint.placement @ self._to_reference(joint)
            at, here = M @ step, tuple(_Carried(j, frame @ step) for j, frame in carried)
            if joint.kind != "fixed":
                here = (*here, _Carried(joint, np.eye(4)))
            if here and self._only_carries(joint.child):
                (only,) = self._children[joint.child]
                todo.append((element, only, at, here))
                continue
            if here and joint.child in self._ends:  # a link that only ends a closure has no body
                self._add_follower(element, self._followers[joint.child][0], at, here)
                continue
            parent = world if self._floats(joint, here) else element
            body = self._add_body(parent, joint.child, at, here)
            below = self._below(joint.child, body)
            todo += [(body, child, np.eye(4), ()) for child in reversed(below)]
        return self.tree

    def _below(self, link: str, element: ET.Element) -> list[Joint]:
        """Add the followers that hang on a link; return the joints that do."""
        for follower in self._followers.get(link, []):
            self._add_follower(element, follower)
        return self._children.get(link, [])

    def _named(self, link: str) -> str:
        if link != WORLD:
            return link
        self._losses.add("names that MuJoCo keeps for itself: written with an underscore", link)
        return f"{WORLD}_"

    def _only_carries(self, link: str) -> bool:
        """Say whether a link has no inertia, carries one joint, and closes nothing."""
        record = self._inertias.links[link]
        weightless = record.mass == 0 and not record.inertia.any()
        children = self._children.get(link, [])
        return weightless and len(children) == 1 and link not in self._closed

    def _to_reference(self, joint: Joint) -> Array:
        """Return the motion of a joint from position zero to `qpos0`, shape (4, 4)."""
        if joint.kind not in SINGLE:
            return np.eye(4)
        return motion_of(joint, {joint.name: home_of(self._d, joint)})

    def _floats(self, joint: Joint, carried: tuple[_Carried, ...]) -> bool:
        """Say whether a joint can be a free joint of MuJoCo: it hangs on a root at rest, at its origin."""
        return (
            joint.kind == "floating"
            and len(carried) == 1
            and joint.parent == self._d.root
            and self._d.base == "fixed"
            and np.array_equal(joint.placement, np.eye(4))
        )

    def _add_body(
        self, parent: ET.Element, link: str, at: Array, carried: tuple[_Carried, ...]
    ) -> ET.Element:
        body = ET.SubElement(parent, "body", {"name": self._named(link)} | pose(at))
        for joint, frame in carried:
            if parent is self.tree.worldbody and self._floats(joint, carried):
                ET.SubElement(body, "freejoint", name=joint.name)
                self._losses.add("floating joints on a base at rest are free joints beside it", joint.name)
                x = home_of(self._d, joint)
                self.tree.qpos += [*x[:3], x[6], *x[3:6]]
            else:
                self._add_joint(body, joint, inverse(frame))
        moving = bool(carried) and not any(
            child.kind == "fixed" and self._inertias.is_solid(child.child)
            for child in self._children.get(link, [])
        )
        add_inertial(body, self._inertias.links[link], self._inertias, moving, self._losses)
        self.tree.bodies[link] = body
        return body

    def _add_joint(self, body: ET.Element, joint: Joint, frame: Array) -> None:
        """Add a joint of the tree; `frame` is its frame in the body at `qpos0`."""
        home = home_of(self._d, joint)
        if joint.kind in SINGLE:
            kind = "slide" if joint.kind == "prismatic" else "hinge"
            element = self._add(body, joint.name, kind, frame, joint.axis, home, at=home[0])
            self.tree.joints[joint.name], self.tree.refs[joint.name] = element, home[0]
            return
        parts = [joint.name + ending for ending in PARTS[joint.kind]]
        for i, part in enumerate(parts[:-1]):
            self.tree.joints[part] = self._add(body, part, "slide", frame, AXES[i], home[i : i + 1])
        kind, at = ("hinge", home[2:]) if joint.kind == "planar" else ("ball", home[-4:])
        turns = self._add(body, parts[-1], kind, frame, AXES[2], at)
        (self.tree.joints if joint.kind == "planar" else self.tree.balls)[parts[-1]] = turns
        if joint.kind != "spherical":
            count = {"planar": "two slides and a hinge", "floating": "three slides and a ball"}[joint.kind]
            self._losses.add(f"{joint.kind} joints are {count}", joint.name)
        elif not np.array_equal(frame[:3, :3], np.eye(3)):
            self._losses.add("ball joints whose coordinates MuJoCo counts about other axes", joint.name)

    def _add(
        self,
        body: ET.Element,
        name: str,
        kind: str,
        frame: Array,
        axis: Array,
        home: tuple[float, ...],
        *,
        at: float = 0.0,
    ) -> ET.Element:
        """Add a joint of MuJoCo, with its positions at `qpos0` and at home."""
        element = ET.SubElement(body, "joint", name=name, type=kind)
        if kind != "slide" and frame[:3, 3].any():
            element.set("pos", numerals(frame[:3, 3]))
        if kind == "ball":
            x, y, z = frame[:3, :3] @ np.array(home[:3])
            self.tree.qpos += [home[3], x, y, z]
        else:
            element.set("axis", numerals(frame[:3, :3] @ axis))
            if at:
                element.set("ref", numeral(at))
            self.tree.qpos += home
        return element

    def _add_follower(
        self,
        parent: ET.Element,
        follower: Follower,
        at: Array | None = None,
        carried: tuple[_Carried, ...] = (),
    ) -> None:
        """Add a body that follows a link; its frame is that of the link where the link has no body."""
        name = f"{follower.name}:{FOLLOWER}"
        frame = np.eye(4) if at is None else follower.frame
        after: Array = np.eye(4)
        behind: list[Array] = []
        for axis in reversed(follower.joints):
            behind.insert(0, inverse(after))
            after = axis.motion() @ after
        moved = frame @ after @ inverse(frame)  # the body's own motion to `qpos0`
        start = follower.frame if at is None else at
        body = ET.SubElement(parent, "body", {"name": name} | pose(start @ moved))
        for joint, place in carried:
            self._add_joint(body, joint, inverse(place @ moved))
        for number, (axis, back) in enumerate(zip(follower.joints, behind, strict=True), 1):
            own, zero = f"{follower.name}:{number}", axis.home[0] if axis.kind != "ball" else 0.0
            self._add(body, own, axis.kind, frame @ back, axis.axis, axis.home, at=zero)
        turn, share = frame[:3, :3], follower.body
        share = replace(share, com=turn @ share.com + frame[:3, 3], inertia=turn @ share.inertia @ turn.T)
        add_inertial(body, share, self._inertias, True, self._losses)
        self.tree.bodies[name] = body
        self.tree.ends[name] = frame


def pose(at: Array) -> dict[str, str]:
    """Return `pos` and `quat` of a placement, none where it is the identity.

    Args:
        at: The placement, shape (4, 4).
    """
    out = {}
    if at[:3, 3].any():
        out["pos"] = numerals(at[:3, 3])
    if not np.array_equal(at[:3, :3], np.eye(3)):
        out["quat"] = numerals(quaternion_of(at[:3, :3]))
    return out
