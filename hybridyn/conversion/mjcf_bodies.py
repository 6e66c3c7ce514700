"""Write the bodies of an MJCF file, with their joints and inertias.

A massless link that only carries one joint has no body: its joint stands in the body of the next link, before
that link's own, as MuJoCo writes universal joints.

Bodies stand where hinges and slides are at home and all other joints at zero: that is MuJoCo's `qpos0`, where
it weighs equalities, and home is `ref`. Positions and axes of joints are in the frame of their body there.
"""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree import ElementTree as ET

import numpy as np

from ..description.joint_words import WORDS
from ..description.names import unique
from ..description.placement import inverse, motion_of
from ..description.records import Array, Description, Joint, Link
from ..errors import ModelError
from ..joints.kinds import JointKind, Turn
from .as_text import add, numeral, principal, put, quaternion_of
from .parts import AXES
from .renamed import held_links
from .request import Losses, home_of
from .small_bodies import LEAST_MOMENT, POINT_INERTIA, Sizes, is_solid, is_weightless

#: Most bodies one inside the other; XML readers stop at 256 elements.
DEEPEST = 240
#: Excess of the largest principal moment over the sum of the others that is rounding, relative to it.
MOMENT_ROUNDING = 1e-12
#: Most freedoms of the joints of one body; none of them turns behind a ball.
MOST_FREEDOMS = 6
#: Name of MuJoCo's own body, which does not move.
WORLD = "world"

#: A joint whose body is still to come, and the body's frame at `qpos0` in the joint's frame.
Carried = tuple[Joint, Array]


class MjcfTree:
    """The bodies of a robot of `parts`.

    Args:
        d: The robot.
        sizes: Its size and the least inertia of its links.
        losses: Receives what is changed.

    Attributes:
        worldbody: The element of the world.
        bodies: Element of each link that has a body, by the link's name.
        joints: Element of each joint, by its name.
        turns: Axes of the frame of each ball joint in those of its body, shape (3, 3), by its name.
        qpos: Home positions of all joints, in MuJoCo's order.
    """

    def __init__(self, d: Description, sizes: Sizes, losses: Losses) -> None:
        self.worldbody = ET.Element("worldbody")
        self.bodies: dict[str, ET.Element] = {}
        self.joints: dict[str, ET.Element] = {}
        self.turns: dict[str, Array] = {}
        self.qpos: list[float] = []
        self._d, self._sizes, self._losses = d, sizes, losses
        self._links = {link.name: link for link in d.links}
        self._children: dict[str, list[Joint]] = {}
        for joint in d.joints:
            self._children.setdefault(joint.parent, []).append(joint)
        self._closed = {end for closure in d.closures for end in (closure.link_a, closure.link_b)}
        self._closed |= held_links(d)
        self._add_all()

    def _add_all(self) -> None:
        """Add all bodies, depth first, which is the order of MuJoCo's `qpos`."""
        root, todo = self._d.root, list[tuple[ET.Element, int, Joint, Array, tuple[Carried, ...]]]()
        first = self._children.get(root, [])
        if root == WORLD and self._d.base == "fixed":
            self.bodies[root] = self.worldbody
            if not is_weightless(self._links[root]):
                self._losses.add("mass and inertia of the world's link, which do not move", root)
        else:
            kind: JointKind = JointKind.FLOATING if self._d.base == "floating" else JointKind.FIXED
            taken = {joint.name for joint in self._d.joints}
            first = [Joint(unique(f"{root}:free", taken), kind, "", root, np.eye(4), AXES[0])]
        todo += [(self.worldbody, 1, joint, np.eye(4), ()) for joint in reversed(_last_free(first))]
        while todo:
            element, depth, joint, M, carried = todo.pop()
            if depth > DEEPEST:
                raise ModelError(
                    f"more than {DEEPEST} bodies one inside the other, up to '{joint.child}'; XML readers "
                    "go no deeper",
                    element=joint.child,
                )
            step = joint.placement
            if joint.kind.single:
                step = step @ motion_of(joint, {joint.name: home_of(self._d, joint)})
            at, here = M @ step, tuple((j, frame @ step) for j, frame in carried)
            if joint.kind != "fixed":
                here = (*here, (joint, np.eye(4)))
            children = _last_free(self._children.get(joint.child, []))
            massless = is_weightless(self._links[joint.child]) and joint.child not in self._closed
            if here and massless and len(children) == 1 and _fits([j for j, _ in here], children[0]):
                todo.append((element, depth, children[0], at, here))
                continue
            body = self._add_body(element, joint.child, at, here)
            todo += [(body, depth + 1, child, np.eye(4), ()) for child in reversed(children)]

    def _add_body(self, parent: ET.Element, link: str, at: Array, carried: tuple[Carried, ...]) -> ET.Element:
        free = carried and carried[0][0].kind is JointKind.FLOATING
        name = unique(f"{WORLD}_", {*self._links}) if link == WORLD else link
        if name != link:
            self._losses.add("names that MuJoCo keeps for itself: written with an underscore", link)
        body = add(self.worldbody if free else parent, "body", name=name, **pose(at))
        for joint, frame in carried:
            if free:
                home = self._d.base_home or JointKind.FLOATING.zero
                if joint.parent:
                    self._losses.add(
                        "floating joints on a base at rest are free joints beside it", joint.name
                    )
                    home = home_of(self._d, joint)
                self.joints[joint.name] = add(body, "freejoint", name=joint.name)
                self.qpos += [*home[:3], home[6], *home[3:6]]
            else:
                self._add_joint(body, joint, inverse(frame))
        welded = (child.child for child in self._children.get(link, []) if child.kind == "fixed")
        moving = bool(carried) and not any(is_solid(self._links[other]) for other in welded)
        _add_inertial(body, self._links[link], self._sizes, moving, self._losses)
        self.bodies[link] = body
        return body

    def _add_joint(self, body: ET.Element, joint: Joint, frame: Array) -> None:
        """Add a joint with its positions; `frame` is its frame in the body at `qpos0`."""
        home, word, turn = home_of(self._d, joint), WORDS[joint.kind].mjcf, frame[:3, :3]
        place = frame[:3, 3] if not joint.kind.slides and frame[:3, 3].any() else None
        out = add(body, "joint", name=joint.name, type=word, pos=place)
        if joint.kind.ball:
            self.turns[joint.name] = turn
            self.qpos += [home[3], *(turn @ np.array(home[:3]))]
            if not np.array_equal(turn, np.eye(3)):
                self._losses.add("ball joints whose coordinates MuJoCo counts about other axes", joint.name)
        else:
            put(out, axis=turn @ joint.axis, ref=home[0] or None)
            self.qpos += home
        self.joints[joint.name] = out


def _fits(before: list[Joint], joint: Joint) -> bool:
    """Say whether MuJoCo takes a joint in a body behind others."""
    kinds = [one.kind for one in before]
    turns = joint.kind.turn is not Turn.NONE
    freedoms = sum(one.kind.nv for one in (*before, joint))
    behind_ball = turns and JointKind.SPHERICAL in kinds
    return freedoms <= MOST_FREEDOMS and not behind_ball and JointKind.FLOATING not in kinds


def _last_free(joints: list[Joint]) -> list[Joint]:
    """Return joints in their order, but free ones last."""
    return sorted(joints, key=lambda joint: joint.kind is JointKind.FLOATING)


def _add_inertial(body: ET.Element, link: Link, sizes: Sizes, moving: bool, losses: Losses) -> None:
    """Add `<inertial>` to a body, with principal moments and axes, which MuJoCo keeps as they are.

    Args:
        body: The body's element.
        sizes: Sizes of the robot.
        moving: Whether MuJoCo needs mass and inertia: the body has a joint.
        losses: Receives what is changed.
    """
    mass, inertia = link.mass or sizes.light.mass, link.inertia
    if not moving and is_weightless(link):
        return
    light = f"written with {numeral(sizes.light.mass)} kg"
    if is_weightless(link):
        losses.add(f"moving links without mass, which MuJoCo refuses: {light}", link.name)
        inertia = sizes.light.inertia
    elif not link.mass:
        losses.add(f"links with inertia but without mass: {light}", link.name)
    moments, axes = principal(inertia)
    possible = np.maximum(moments, 0.0)
    if moving and moments.min() < LEAST_MOMENT:
        losses.add(
            "links without inertia about an axis, which MuJoCo refuses: written with a small one", link.name
        )
        possible = np.maximum(moments, max(LEAST_MOMENT, POINT_INERTIA * mass * sizes.size**2))
    largest = int(np.argmax(possible))
    most = np.delete(possible, largest).sum()
    if possible[largest] > most * (1 + MOMENT_ROUNDING) or moments.min() < 0:
        losses.add("inertias that no body can have: principal moments are changed", link.name)
    possible[largest] = min(possible[largest], most)
    quat = None if np.array_equal(axes, np.eye(3)) else quaternion_of(axes)
    add(body, "inertial", pos=link.com, mass=mass, diaginertia=possible, quat=quat)


def pose(at: Array) -> dict[str, Iterable[float] | None]:
    """Return `pos` and `quat` of a placement (4, 4), None where it is the identity."""
    turned = not np.array_equal(at[:3, :3], np.eye(3))
    return {
        "pos": at[:3, 3] if at[:3, 3].any() else None, "quat": quaternion_of(at[:3, :3]) if turned else None
    }  # fmt: skip
