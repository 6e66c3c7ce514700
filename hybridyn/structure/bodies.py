"""Rigid bodies of a robot: links that are connected by fixed joints form one body.

A body's frame is the frame of its topmost link. This is the child frame of the joint that moves the body,
and Pinocchio's joint frame. Joints are numbered as in `pin.buildModelFromXML`: depth-first, siblings by name
(`Description.siblings`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import ClassVar, NamedTuple

import numpy as np

from ..description.names import did_you_mean
from ..description.records import Description, Joint, Link, Load
from ..errors import ModelError
from ..joints.kinds import JointKind
from ..linkage.joints import TreeJoint
from ..spatial import LARGEST, Array
from .forms import check_form

#: Extents below this part of the largest are zero, but for the rounding of placements.
NO_EXTENT = 1e-12


def first_extent(*extents: float) -> float:
    """Return the first extent that is more than rounding, 1 if there is none [m]."""
    least = NO_EXTENT * max(extents)
    return next((extent for extent in extents if extent > least), 1.0)


@dataclass(eq=False)
class Body:
    """One rigid body.

    Attributes:
        name: Name of its heaviest link, or of the topmost link if no link has mass.
        joint: Number of the joint that moves it, -1 for the root.
        heaviest: Mass of the link after which the body is named [kg].
        mass: Mass [kg].
        com: Centre of mass, shape (3,), [m], body frame.
        inertia: Inertia about the centre of mass, shape (3, 3), [kg m^2], body axes.
    """

    name: str
    joint: int
    heaviest: float = 0.0
    mass: float = 0.0
    com: Array = field(default_factory=lambda: np.zeros(3))
    inertia: Array = field(default_factory=lambda: np.zeros((3, 3)))

    @property
    def massless(self) -> bool:
        """Whether the body has neither mass nor inertia."""
        return self.mass == 0.0 and not self.inertia.any()

    def nameless(self) -> "Body":
        """Return the body without what tells it from that of an equal module."""
        return Body("", 0, 0.0, self.mass, self.com, self.inertia)

    def add(self, link: Link, R: Array, p: Array) -> None:
        """Add a link whose frame has the placement (R, p) in the body frame."""
        if (mass := float(link.mass)) > self.heaviest:
            self.name, self.heaviest = link.name, mass
        com, inertia = p + R @ link.com, R @ link.inertia @ R.T
        total, first = self.mass + link.mass, self.massless
        self.inertia = self.inertia + inertia
        if first and total > 0:
            self.com = self.com + com
        elif total > 0:
            d = com - self.com
            # Parallel axis theorem about the common centre, in the form without cancellation.
            moved = self.mass * link.mass / total * (d @ d * np.eye(3) - np.outer(d, d))
            self.inertia = self.inertia + moved
            self.com = self.com + link.mass / total * d
        self.mass = total


class BodyJoint(NamedTuple):
    """A movable joint between two bodies.

    Attributes:
        joint: Record of the joint in the description.
        parent: Number of the parent body.
        child: Number of the child body.
        R: Child axes in the parent *body* at joint position zero, shape (3, 3).
        p: Child origin in the parent *body* at joint position zero, shape (3,), [m].
    """

    joint: Joint
    parent: int
    child: int
    R: Array
    p: Array

    def in_tree(self, name: str, parent: int) -> TreeJoint:
        """Return the joint of a tree, in which its parent body has another number."""
        return TreeJoint(name, self.joint.kind, parent, self.R, self.p, self.joint.axis, self.joint.pitch)


@dataclass(frozen=True, eq=False)
class Bodies:
    """The tree of bodies.

    Attributes:
        bodies: Bodies; body 0 contains the root link, and body i + 1 is the child of `joints[i]`.
        joints: Movable joints in Pinocchio's order.
        place: For each link name, the number of its body and the placement (R, p) of the link in that body.
    """

    bodies: list[Body]
    joints: list[BodyJoint]
    place: dict[str, tuple[int, Array, Array]]

    @cached_property
    def reach(self) -> float:
        """Longest offset from one joint to the next [m]; distances much smaller than this count as zero."""
        return _farthest([j.p for j in self.joints]) or 1.0

    @cached_property
    def size(self) -> float:
        """Characteristic length of the robot [m], for parts that have no extent themselves."""
        spreads = [float(np.sqrt(max(np.trace(b.inertia), 0.0) / b.mass)) for b in self.bodies if b.mass]
        centre = _farthest([b.com for b in self.bodies])
        return first_extent(_farthest([j.p for j in self.joints]), max([centre, *spreads]))

    def path(self, a: int, b: int) -> list[int]:
        """Return the numbers of the joints between two bodies."""
        out = []
        while a != b:
            deeper = max(a, b)  # parents come first, so the larger number is never an ancestor of the other
            out.append(deeper - 1)
            up = self.joints[deeper - 1].parent
            a, b = (up, b) if deeper == a else (a, up)
        return out


def _farthest(points: Sequence[Array]) -> float:
    """Return the largest coordinate of points, each of shape (3,), [m]; 0 without any."""
    return float(np.abs(np.array(points, dtype=float)).max(initial=0.0))


def merge_fixed_joints(description: Description) -> Bodies:
    """Build the tree of bodies of a description."""
    links = {link.name: link for link in description.links}
    children: dict[str, list[Joint]] = {}
    for joint in description.joints:
        children.setdefault(joint.parent, []).append(joint)
    identity = (np.eye(3), np.zeros(3))
    root = Body(description.root, -1)
    root.add(links[description.root], *identity)
    out = Bodies([root], [], {description.root: (0, *identity)})
    stack = [*reversed(description.siblings(children.get(description.root, [])))]
    while stack:
        joint = stack.pop()
        body, R, p = out.place[joint.parent]
        R, p = R @ joint.placement[:3, :3], p + R @ joint.placement[:3, 3]
        if joint.kind != "fixed":
            out.joints.append(BodyJoint(joint, body, len(out.bodies), R, p))
            body, R, p = len(out.bodies), *identity
            out.bodies.append(Body(joint.child, body - 1))
        out.place[joint.child] = (body, R, p)
        out.bodies[body].add(links[joint.child], R, p)
        stack.extend(reversed(description.siblings(children.get(joint.child, []))))
    if len(out.place) != len(links):
        lost = sorted(set(links) - set(out.place))
        raise ModelError(f"links {lost} are not connected to the root link", file=description.source)
    return out


@dataclass(frozen=True)
class Payload:
    """A rigid body that is attached to a link; its mass, centre and inertia are added to those of the link.

    A payload changes the robot. `hybridyn.with_effects` returns the changed robot, which then has the payload
    under any effects.

    Attributes:
        link: Name of the link.
        mass: Mass [kg].
        com: Centre of mass, shape (3,), [m], link frame.
        inertia: Inertia about the centre of mass, shape (3, 3), [kg m^2], link axes.
    """

    link: str
    mass: float
    com: tuple[float, ...] = (0.0, 0.0, 0.0)
    inertia: tuple[tuple[float, ...], ...] = ((0.0,) * 3,) * 3
    name: ClassVar[str] = "payload"

    def __post_init__(self) -> None:
        check_form(self)
        # Tuples, so that equal payloads compare equal, whatever sequences they were built from.
        com, inertia = np.asarray(self.com, dtype=float), np.asarray(self.inertia, dtype=float)
        if com.shape != (3,) or inertia.shape != (3, 3):
            raise ModelError(f"payload on '{self.link}': com has 3 numbers, inertia 3 x 3", element=self.link)
        object.__setattr__(self, "com", tuple(com.tolist()))
        object.__setattr__(self, "inertia", tuple(tuple(row) for row in inertia.tolist()))
        numbers = np.array([self.mass, *com, *inertia.ravel()])
        if not (np.abs(numbers) <= LARGEST).all():  # not a number, too
            raise ModelError(
                f"payload on '{self.link}': numbers must be finite, and at most {LARGEST:.0e}",
                element=self.link,
            )
        if self.mass < 0 or not np.array_equal(inertia, inertia.T):
            raise ModelError(
                f"payload on '{self.link}': mass must not be negative, inertia symmetric", element=self.link
            )
        moments = np.linalg.eigvalsh(inertia)
        if moments[0] < -1e-12 * abs(moments[-1]) or moments[0] + moments[1] < moments[2] * (1 - 1e-9):
            raise ModelError(
                f"payload on '{self.link}': no body has principal moments {moments}", element=self.link
            )

    def onto(self, description: Description) -> Description:
        """Return the description with the payload added to its link.

        Raises:
            ModelError: The link is unknown.
        """
        links = {link.name: link for link in description.links}
        if self.link not in links:
            raise ModelError(
                f"payload on unknown link '{self.link}'{did_you_mean(self.link, links)}", element=self.link
            )
        own = links[self.link]
        com, inertia = np.array(self.com), np.array(self.inertia)
        load = Load(self.link, self.mass, com, inertia, own.mass, own.com, own.inertia)
        every = tuple(loaded(link, load) if link.name == self.link else link for link in description.links)
        return replace(description, links=every, loads=(*description.loads, load))


def carrying(description: Description) -> Description:
    """Return the description with the payload that its files state as an effect added to its link.

    Raises:
        ModelError: Its link is unknown, or no body has its numbers.
    """
    stated = [values for name, values in description.effects if name == Payload.name]
    if not stated:
        return description
    others = tuple(effect for effect in description.effects if effect[0] != Payload.name)
    description = replace(description, effects=others)
    for values in stated:
        description = Payload(**values).onto(description)
    return description


def loaded(link: Link, load: Load) -> Link:
    """Return a link with the numbers of its own in a load and of the body that was added."""
    body, origin = Body("", -1), (np.eye(3), np.zeros(3))
    body.add(replace(link, mass=load.own_mass, com=load.own_com, inertia=load.own_inertia), *origin)
    body.add(Link("", load.mass, load.com, load.inertia), *origin)
    return replace(link, mass=body.mass, com=body.com, inertia=body.inertia)


def payloads_of(description: Description) -> tuple[Payload, ...]:
    """Return the payloads that were added to the links of a description.

    Raises:
        ModelError: A payload has numbers of no body.
    """
    return tuple(
        Payload(load.name, load.mass, tuple(load.com.tolist()), tuple(map(tuple, load.inertia.tolist())))
        for load in description.loads
    )


def home_of(description: Description, bodies: Bodies, kinds: list[JointKind], base: str) -> Array:
    """Return the home position of the whole robot, shape (nq,)."""
    parts = [np.array(description.base_home or JointKind.FLOATING.zero)] if base != "fixed" else []
    for joint, kind in zip(bodies.joints, kinds[len(parts) :], strict=True):
        value = np.asarray(description.home.get(joint.joint.name, (0.0,)), dtype=float)
        if kind.endless:
            angle = value[0] if len(value) == 1 else np.arctan2(value[1], value[0])
            value = np.array([np.cos(angle), np.sin(angle)])
        parts.append(value if len(value) == kind.nq else np.array(kind.zero))
    return np.concatenate(parts) if parts else np.zeros(0)
