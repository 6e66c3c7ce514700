"""Make a robot of what MuJoCo has: hinges, slides, balls and free bodies, closed by points, axes and welds.

A planar joint, or a floating one inside the tree, becomes a chain. A closure that MuJoCo has no word for
becomes the weld of a *follower*: a body of its own that hangs on one link by the joints that the closure
leaves free, and is welded to the other link. It has half of that link's inertia. Together they are the same
rigid body, so that the motion stays the same; a body of small mass would be a soft weld.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...description.closure_forms import SIDEWAYS
from ...description.loop_signs import Bodies
from ...description.names import unique
from ...description.placement import inverse, placement_from, poses_at
from ...description.records import Array, Closure, Description, Joint, JointKind, Link
from ..home import home_of
from ..numerals import quaternion_of
from ..request import Losses
from .bodies import AXES, Sizes, is_solid, is_weightless

FULL = (0, 1, 2)
#: End of the name of a follower, after the closure's name.
FOLLOWER = "follower"
#: The joints that stand for a joint, by its kind: in words, and the ending and the kind of each.
PARTS: dict[JointKind, tuple[str, dict[str, JointKind]]] = {
    "planar": ("two slides and a hinge", {"_x": "prismatic", "_y": "prismatic", "_turn": "revolute"}),
    "floating": (
        "three slides and a ball",
        {"_x": "prismatic", "_y": "prismatic", "_z": "prismatic", "_turn": "spherical"},
    ),
}


class _Step(NamedTuple):
    """A joint of a chain: its kind, its axis in the chain's frame (3,), and its position at home."""

    kind: JointKind
    axis: Array
    home: tuple[float, ...]


class Parts:
    """A robot whose joints and closures become those of MuJoCo.

    Args:
        d: The robot.
        sizes: Its size and the least inertia of its links.
        losses: Receives what is changed.
    """

    def __init__(self, d: Description, sizes: Sizes, losses: Losses) -> None:
        self._d, self._light, self._losses = d, sizes.light, losses
        self._links, self._home = {link.name: link for link in d.links}, dict(d.home)
        self._joints: list[Joint] = []
        self._poses = poses_at(d, d.home)
        welded = {link for link, body in Bodies(d).of.items() if body == d.root}
        self._still = welded if d.base == "fixed" else set()

    def described(self) -> Description:
        """Return the robot; each of its joints and closures has an equal in MuJoCo."""
        ends, closures = self._weightless_ends(), []
        for closure in self._d.closures:
            if {closure.link_a, closure.link_b} & ends or (
                closure.translations != FULL or closure.rotation == "perpendicular"
            ):
                self._losses.add(
                    "closures are a weld to a body of their own, which follows one link", closure.name
                )
                closure = self._followed(closure, ends)
            closures.append(closure)
        followers, self._joints = self._joints, []
        ending = {end for closure in closures for end in (closure.link_a, closure.link_b)}
        carrying = Counter(joint.parent for joint in (*self._d.joints, *followers))
        for joint in self._d.joints:
            link = joint.child
            is_body = not is_weightless(self._links[link]) or carrying[link] != 1 or link in ending
            hangs_free = joint.parent == self._d.root and np.array_equal(joint.placement, np.eye(4))
            is_free = joint.kind == "floating" and hangs_free and self._d.base == "fixed" and is_body
            if joint.kind in PARTS and not is_free:
                self._split(joint)
            else:
                self._joints.append(joint)
        joints = (*self._joints, *followers)
        return replace(
            self._d,
            links=tuple(self._links.values()),
            joints=joints,
            closures=tuple(closures),
            home=self._home,
        )

    def _split(self, joint: Joint) -> None:
        """Add the chain that stands for a planar or floating joint."""
        words, parts = PARTS[joint.kind]
        self._losses.add(f"{joint.kind} joints are {words}", joint.name)
        home, steps = home_of(self._d, joint), {}
        for i, (ending, kind) in enumerate(parts.items()):
            at = home[i:] if kind == "spherical" else home[i : i + 1]
            steps[joint.name + ending] = _Step(kind, AXES[i % 3], at)
        self._chain(steps, (joint.parent, joint.child), joint.placement, joint.damping)

    def _chain(self, steps: dict[str, _Step], ends: tuple[str, str], at: Array, damping: float = 0.0) -> None:
        """Add joints by name from a parent to a child link, with massless links between them.

        Args:
            at: Frame of the chain in the parent, shape (4, 4).
        """
        parent, child = ends
        for name, step in steps.items():
            below = child
            if name != [*steps][-1]:
                below = unique(f"{child}:{name}", {*self._links})
                self._links[below] = Link(below, 0.0, np.zeros(3), np.zeros((3, 3)))
            self._joints.append(Joint(name, step.kind, parent, below, at, step.axis, damping=damping))
            self._home[name] = step.home
            parent, at = below, np.eye(4)
        if not steps:
            self._joints.append(Joint(child, "fixed", parent, child, at, AXES[0]))

    def _followed(self, closure: Closure, ends: set[str]) -> Closure:
        """Add the follower of a closure, which takes its inertia from a link, and return its weld."""
        links = closure.link_a, closure.link_b
        solid = [is_solid(self._links[link]) and link not in self._still for link in links]
        first = links[0] in ends or (links[1] not in ends and (solid[1] or not solid[0]))
        frames = closure.frame_a, closure.frame_b
        (on, welded), (own, other) = (links, frames) if first else (links[::-1], frames[::-1])
        name = f"{closure.name}:{FOLLOWER}"
        if any(solid):
            half = self._links[welded]
            half = replace(half, mass=half.mass / 2, inertia=half.inertia / 2)
            self._links[welded], turn = half, other[:3, :3]
            com = turn.T @ (half.com - other[:3, 3])
            body = replace(half, name=name, com=com, inertia=turn.T @ half.inertia @ turn)
        else:
            body = replace(self._light, name=name)
            if welded not in self._still:
                self._losses.add(
                    "closures between links without mass: a body of small mass follows them", closure.name
                )
        self._links[name] = body
        A, B = (self._poses[link] @ frame for link, frame in zip(links, frames, strict=True))
        place, steps = _steps(closure, inverse(A) @ B, first)
        named = {f"{closure.name}:{number}": step for number, step in enumerate(steps, 1)}
        self._chain(named, (on, name), own @ place)
        weld = replace(closure, translations=FULL, rotation="fixed")
        if first:
            return replace(weld, link_a=name, frame_a=np.eye(4))
        return replace(weld, link_b=name, frame_b=np.eye(4))

    def _weightless_ends(self) -> set[str]:
        """Return the moving links that have no inertia and only end a closure.

        MuJoCo refuses bodies without mass: the follower of the closure takes their place.
        """
        carrying = {joint.parent for joint in self._d.joints} | self._still
        light = {name for name, link in self._links.items() if is_weightless(link)} - carrying
        pairs = [(closure.link_a, closure.link_b) for closure in self._d.closures]
        counted = Counter(end for pair in pairs for end in pair)
        alone = [{*pair} & light for pair in pairs if not {*pair} <= light]
        return {end for ends in alone for end in ends if counted[end] == 1}


def _steps(closure: Closure, X: Array, first: bool) -> tuple[Array, list[_Step]]:
    """Return the joints that a closure leaves free, from one of its frames to the other.

    Args:
        X: Place of frame B in A at home, shape (4, 4).
        first: Whether they lead from A to B; else those from A to B in reverse.

    Returns:
        Place of the other frame in the one at zero, shape (4, 4), and the joints in that frame.
    """
    turn, turns = _turns(closure, X[:3, :3])
    free = [i for i in range(3) if i not in closure.translations]
    if first:
        slides = [_Step("prismatic", turn.T @ AXES[i], (float(X[i, 3]),)) for i in free]
        return placement_from(turn, np.zeros(3)), [*slides, *turns]
    back = [
        _Step(kind, turn @ axis, (*(-x for x in home[:3]), *home[3:])) for kind, axis, home in reversed(turns)
    ]
    slides = [_Step("prismatic", AXES[i], (-float(X[i, 3]),)) for i in free]
    return placement_from(turn.T, np.zeros(3)), [*back, *slides]


def _turns(closure: Closure, R: Array) -> tuple[Array, list[_Step]]:
    """Return B's axes at zero in A, shape (3, 3), and the turns from A to B; R are B's axes at home."""
    if closure.rotation == "fixed":
        return np.eye(3), []
    if closure.rotation == "parallel":
        return np.eye(3), [_Step("revolute", AXES[2], (float(np.arctan2(R[1, 0], R[0, 0])),))]
    if closure.rotation == "free":
        w, x, y, z = quaternion_of(R)
        return np.eye(3), [_Step("spherical", AXES[2], (x, y, z, w))]
    alpha = float(np.arctan2(R[1, 2], R[0, 2]))
    c, s = np.cos(alpha), np.sin(alpha)
    rest = SIDEWAYS.T @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) @ R
    beta = float(np.arctan2(rest[1, 0], rest[0, 0]))
    return SIDEWAYS, [
        _Step("revolute", SIDEWAYS.T @ AXES[2], (alpha,)),
        _Step("revolute", AXES[2], (beta,)),
    ]
