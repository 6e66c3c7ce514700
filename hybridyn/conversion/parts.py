"""Make a robot of the joints and closures that a format has.

A planar joint, a floating one inside the tree, or a ball becomes a chain. A closure that a format has no word
for becomes one that it has, behind a chain of joints that the closure leaves free. The links of chains are
massless.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ..description.closure_forms import FULL, SIDEWAYS
from ..description.names import unique
from ..description.placement import inverse, placement_from, poses_at
from ..description.records import Array, Closure, Coupling, Description, Joint, massless
from ..joints.kinds import JointKind, RotationKind, Turn
from ..linkage.angles import angles_of, rate_map
from ..spatial import rotation_from_quaternion
from .as_text import quaternion_of
from .renamed import effects_on
from .request import Losses, home_of

AXES = np.eye(3)


def in_words(kind: JointKind) -> str:
    """Return what becomes of joints that are written as their parts: "two slides and a hinge"."""
    if kind is JointKind.SPHERICAL:
        return f"{kind} joints are three hinges"
    slides = ("", "a slide", "two slides", "three slides")[kind.shift]
    turn = {Turn.NONE: "", Turn.BALL: "a ball"}.get(kind.turn, "a hinge")
    return f"{kind} joints are {' and '.join(filter(None, (slides, turn)))}"


class _ChainJoint(NamedTuple):
    """A joint of a chain: its kind, its axis in the chain's frame (3,), and its position at home."""

    kind: JointKind
    axis: Array
    home: tuple[float, ...]


def in_parts(
    d: Description,
    losses: Losses,
    kinds: Collection[str],
    behind: Callable[[Closure], RotationKind | None],
) -> Description:
    """Return a robot in which chains of massless links stand for what a format does not have.

    Args:
        d: The robot.
        losses: Receives what is changed.
        kinds: Kinds of joints that the format does not have, and whose parts it has.
        behind: Returns the rotation that a closure locks behind a chain, "parallel" of a universal one; None
            for a closure that the format has.
    """
    parts, closures = RobotParts(d, losses), []
    for joint in d.joints:
        parts.split(joint) if joint.kind in kinds else parts.joints.append(joint)
    for closure in d.closures:
        rotation = behind(closure)
        if rotation is not None:
            losses.add("closures are joints with massless links, and a closure behind them", closure.name)
            closure = parts.led(closure, rotation)
        closures.append(closure)
    return parts.described(closures)


def hinge_angles(quaternion: Array) -> Array:
    """Return the angles of the hinges about x, y, z that stand for a ball, shape (3,), [rad].

    Args:
        quaternion: Position of the ball, x, y, z, w, shape (4,).
    """
    out: Array = -angles_of(rotation_from_quaternion(quaternion).T)  # R^T = Rz(-z) Ry(-y) Rx(-x)
    return out


def hinge_rates(quaternion: Array, spin: Array) -> Array:
    """Return the rates of the hinges of `hinge_angles`, shape (3,), [rad/s].

    Args:
        quaternion: As for `hinge_angles`.
        spin: Angular velocity of the child, in its own axes, shape (3,), [rad/s].
    """
    out: Array = rate_map(angles_of(rotation_from_quaternion(quaternion).T)[None])[0] @ spin
    return out


def without_screws(d: Description, losses: Losses) -> Description:
    """Return a robot in which a hinge, and a slide that follows it, stand for each screw."""
    taken = {link.name for link in d.links} | {joint.name for joint in d.joints}
    links, joints, couplings, home = [*d.links], list[Joint](), [*d.couplings], dict(d.home)
    for joint in d.joints:
        if joint.kind is not JointKind.SCREW:
            joints.append(joint)
            continue
        losses.add("screws are a hinge and a slide that follows it", joint.name)
        slide, between = (unique(f"{joint.name}_{ending}", taken) for ending in ("slide", "thread"))
        links.append(massless(between, joint.line, between=True))
        joints.append(replace(joint, kind=JointKind.REVOLUTE, pitch=0.0, child=between))
        joints.append(Joint(slide, JointKind.PRISMATIC, between, joint.child, np.eye(4), joint.axis))
        couplings.append(Coupling(slide, ((slide, 1.0), (joint.name, -joint.pitch)), 0.0, joint.line))
        home[slide] = (joint.pitch * home_of(d, joint)[0],)
    return replace(d, links=tuple(links), joints=tuple(joints), couplings=tuple(couplings), home=home)


class RobotParts:
    """A robot in the making: its links by name, its joints, its home posture, and the followers of links."""

    def __init__(self, d: Description, losses: Losses) -> None:
        self.d, self.losses = d, losses
        self.links, self.home = {link.name: link for link in d.links}, dict(d.home)
        self.joints: list[Joint] = []
        self._stand_for: dict[str, list[str]] = {}
        self.followers: dict[str, list[str]] = {}
        self._poses = poses_at(d, d.home)
        self.taken = {*self.links, *(joint.name for joint in d.joints), *(c.name for c in d.closures)}

    def described(self, closures: Collection[Closure]) -> Description:
        """Return the robot, with these closures."""
        links, joints = tuple(self.links.values()), tuple(self.joints)
        effects = effects_on(self.d, {}, self._stand_for)
        d = replace(self.d, effects=tuple((name, self._shared(name, x)) for name, x in effects))
        return replace(d, links=links, joints=joints, closures=tuple(closures), home=self.home)

    def _shared(self, effect: str, numbers: dict[str, Any]) -> dict[str, Any]:
        """Return the numbers of an effect, of whose followed links the followers are relieved, too."""
        if effect != "gravity_compensation":
            return numbers
        own = numbers["fraction"]
        pairs = [(name, link) for link, names in self.followers.items() for name in names]
        return {"fraction": own | {name: own[link] for name, link in pairs if link in own}}

    def split(self, joint: Joint) -> None:
        """Add the chain of parts that stands for a joint."""
        self.losses.add(in_words(joint.kind), joint.name)
        home, steps = home_of(self.d, joint), {}
        if joint.kind is JointKind.SPHERICAL:
            home = tuple(hinge_angles(np.array(home)).tolist())
        for i, (ending, kind) in enumerate(joint.kind.parts.items()):
            at = home[i : i + kind.nq]
            steps[joint.name + ending] = _ChainJoint(kind, AXES[i % 3], at)
        self.home.pop(joint.name, None)
        ends = joint.parent, joint.child
        self._stand_for[joint.name] = self.chain(steps, ends, joint.placement, joint.damping)

    def chain(
        self, steps: dict[str, _ChainJoint], ends: tuple[str, str], at: Array, damping: float = 0.0
    ) -> list[str]:
        """Add joints by name from a parent to a child link, with massless links between them.

        Args:
            at: Frame of the chain in the parent, shape (4, 4).

        Returns:
            The names of the joints that move, which are new.
        """
        (parent, child), out = ends, list[str]()
        for name, step in steps.items():
            below, name = child, unique(name, self.taken)
            if step is not [*steps.values()][-1]:
                below = unique(f"{child}_{name}", self.taken)
                self.links[below] = massless(below)
            self.joints.append(Joint(name, step.kind, parent, below, at, step.axis, damping=damping))
            self.home[name] = step.home
            out.append(name)
            parent, at = below, np.eye(4)
        if not steps:
            self.joints.append(Joint(child, JointKind.FIXED, parent, child, at, AXES[0]))
        return out

    def led(self, closure: Closure, rotation: RotationKind) -> Closure:
        """Add a chain to a closure's first link, and return the closure from its end to the second link.

        Args:
            rotation: The rotation that is left to lock: the closure's, or "parallel" of a universal one,
                whose chain turns about the first axis.
        """
        turning = rotation != closure.rotation
        at, steps = self.free(closure if turning else replace(closure, rotation="fixed"), True)
        end = unique(f"{closure.name}_end", self.taken)
        self.links[end] = massless(end)
        named = {f"{closure.name}_{n}": step for n, step in enumerate(steps[:-1] if turning else steps, 1)}
        self.chain(named, (closure.link_a, end), closure.frame_a @ at)
        out = replace(closure, link_a=end, frame_a=np.eye(4), translations=FULL, rotation=rotation)
        return replace(out, turn=np.eye(3)) if turning else out

    def free(self, closure: Closure, first: bool) -> tuple[Array, list[_ChainJoint]]:
        """Return the joints that a closure leaves free, from one of its frames to the other.

        Args:
            first: Whether they lead from A to B; else those from A to B in reverse.

        Returns:
            Place of the other frame in the one at zero, shape (4, 4), and the joints in that frame.
        """
        X = (
            inverse(self._poses[closure.link_a] @ closure.frame_a)
            @ self._poses[closure.link_b]
            @ closure.frame_b
        )
        turn, turns = _turns(closure, X[:3, :3])
        free = [i for i in range(3) if i not in closure.translations]
        if first:
            slides = [_ChainJoint(JointKind.PRISMATIC, turn.T @ AXES[i], (float(X[i, 3]),)) for i in free]
            return placement_from(turn, np.zeros(3)), [*slides, *turns]
        back = [
            _ChainJoint(kind, turn @ axis, (*(-x for x in home[:3]), *home[3:]))
            for kind, axis, home in reversed(turns)
        ]
        slides = [_ChainJoint(JointKind.PRISMATIC, AXES[i], (-float(X[i, 3]),)) for i in free]
        return placement_from(turn.T, np.zeros(3)), [*back, *slides]


def _turns(closure: Closure, R: Array) -> tuple[Array, list[_ChainJoint]]:
    """Return B's axes at zero in A, shape (3, 3), and the turns from A to B; R are B's axes at home."""
    if closure.rotation == "fixed":
        return np.eye(3), []
    if closure.rotation == "parallel":
        return np.eye(3), [_ChainJoint(JointKind.REVOLUTE, AXES[2], (float(np.arctan2(R[1, 0], R[0, 0])),))]
    if closure.rotation == "free":
        w, x, y, z = quaternion_of(R)
        return np.eye(3), [_ChainJoint(JointKind.SPHERICAL, AXES[2], (x, y, z, w))]
    alpha = float(np.arctan2(R[1, 2], R[0, 2]))
    c, s = np.cos(alpha), np.sin(alpha)
    rest = SIDEWAYS.T @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) @ R
    beta = float(np.arctan2(rest[1, 0], rest[0, 0]))
    return SIDEWAYS, [
        _ChainJoint(JointKind.REVOLUTE, SIDEWAYS.T @ AXES[2], (alpha,)),
        _ChainJoint(JointKind.REVOLUTE, AXES[2], (beta,)),
    ]
