"""Mirror images of mechanisms, other frames on their links, and several mechanisms joined to one.

Frames stay right-handed: a link's frame in the image is S F S, of its frame F and a mirror S of signs.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from hybridyn.description.records import Description, Joint, JointKind
from tests.robots.sketch import placement, rotation_of, turn, unit

#: No mirror, those of the coordinate planes, and that of the origin.
MIRRORS = tuple(
    np.diag(signs) for signs in np.array([[1, 1, 1.0], [-1, 1, 1], [1, -1, 1], [1, 1, -1], [-1, -1, -1]])
)


def image(description: Description, S: np.ndarray, flipped: Mapping[str, bool]) -> Description:
    """Return the mirror image of a mechanism; its joints move as those of the mechanism, mirrored.

    Args:
        S: Diagonal matrix of signs.
        flipped: Whether a joint of one freedom counts its position the other way, by its name.
    """
    both = placement(S, np.zeros(3))
    signs = {joint.name: -1.0 if flipped.get(joint.name) else 1.0 for joint in description.joints}
    joints = [
        replace(
            joint,
            placement=both @ joint.placement @ both,
            axis=joint.axis if joint.kind == "planar" else signs[joint.name] * _direction(joint, S),
            pitch=np.linalg.det(S) * joint.pitch,
        )
        for joint in description.joints
    ]
    kinds = {joint.name: joint.kind for joint in description.joints}
    return replace(
        description,
        links=tuple(replace(x, com=S @ x.com, inertia=S @ x.inertia @ S) for x in description.links),
        joints=tuple(joints),
        closures=tuple(
            replace(c, frame_a=both @ c.frame_a @ both, frame_b=both @ c.frame_b @ both)
            for c in description.closures
        ),
        couplings=tuple(
            replace(c, terms=tuple((name, signs[name] * x) for name, x in c.terms))
            for c in description.couplings
        ),
        home={
            name: position(kinds[name], np.array(q), S, signs[name]) for name, q in description.home.items()
        },
    )


def _direction(joint: Joint, S: np.ndarray) -> np.ndarray:
    """Return the mirrored axis: mirrors turn the sense of rotations."""
    return S @ joint.axis * (1.0 if joint.kind.slides else np.linalg.det(S))


def position(kind: JointKind, q: np.ndarray, S: np.ndarray, sign: float) -> tuple[float, ...]:
    """Return the position of a joint in the mirror image."""
    if kind.ball:
        n, turned = kind.shift, np.linalg.det(S) * S
        parts = [S[:n, :n] @ q[:n], turned @ q[n : n + 3], q[-1:]]
    elif kind == "planar":
        parts = [S[:2, :2] @ q[:2], q[2:3], S[0, 0] * S[1, 1] * q[3:]]
    else:
        parts = [q[:1], sign * q[1:]] if kind.endless else [sign * q]
    return tuple(map(float, np.concatenate(parts)))


def reframed(description: Description, turns: Mapping[str, np.ndarray]) -> Description:
    """Return the same mechanism with other frames of some links.

    Args:
        turns: Axes of a link's new frame in its old one, shape (3, 3), by the link; none on planar joints.
    """

    def placed(link: str) -> np.ndarray:
        return placement(turns.get(link, np.eye(3)), np.zeros(3))

    joints, home, links = [], dict(description.home), []
    for joint in description.joints:
        Q = placed(joint.child)[:3, :3]
        M = placed(joint.parent).T @ joint.placement @ placed(joint.child)
        joints.append(replace(joint, placement=M, axis=Q.T @ joint.axis))
        if joint.kind.ball and joint.name in home:
            home[joint.name] = position(joint.kind, np.array(home[joint.name]), Q.T, 1.0)
    for link in description.links:
        Q = placed(link.name)[:3, :3]
        inertia = Q.T @ link.inertia @ Q
        links.append(replace(link, com=Q.T @ link.com, inertia=(inertia + inertia.T) / 2))
    closures = [
        replace(c, frame_a=placed(c.link_a).T @ c.frame_a, frame_b=placed(c.link_b).T @ c.frame_b)
        for c in description.closures
    ]
    return replace(description, links=tuple(links), joints=tuple(joints), closures=tuple(closures), home=home)


def from_to(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return a rotation that turns unit vector a to unit vector b."""
    x = unit(np.cross(a, np.eye(3)[np.argmin(np.abs(a))]))
    normal = np.cross(a, b)
    angle = float(np.arctan2(np.linalg.norm(normal), a @ b))
    return turn(unit(normal) if np.linalg.norm(normal) > 1e-9 else x, angle)


def with_axes(
    description: Description, axes: Mapping[str, np.ndarray], rng: np.random.Generator | None
) -> Description:
    """Turn the frames of links so that joints of one freedom have the given axes, to the bit.

    Args:
        axes: Axis in the child's frame by the joint's name.
        rng: Draws how frames turn about these axes, and frames of balls; None leaves them.
    """
    turns = {}
    for joint in description.joints:
        if joint.kind.single and joint.name in axes:
            own = turn(axes[joint.name], rng.uniform(-3.0, 3.0)) if rng else np.eye(3)
            turns[joint.child] = from_to(axes[joint.name], joint.axis) @ own
        elif joint.kind.ball and rng:
            turns[joint.child] = rotation_of(unit(rng.normal(size=4)))
    out = reframed(description, turns)
    return replace(
        out, joints=tuple(replace(joint, axis=axes.get(joint.name, joint.axis)) for joint in out.joints)
    )


def renamed(description: Description, stem: str) -> Description:
    """Return the mechanism with a stem before all names."""
    new = stem.__add__
    return replace(
        description,
        links=tuple(replace(x, name=new(x.name)) for x in description.links),
        joints=tuple(
            replace(x, name=new(x.name), parent=new(x.parent), child=new(x.child)) for x in description.joints
        ),
        closures=tuple(
            replace(x, name=new(x.name), link_a=new(x.link_a), link_b=new(x.link_b))
            for x in description.closures
        ),
        couplings=tuple(
            replace(x, name=new(x.name), terms=tuple((new(name), y) for name, y in x.terms))
            for x in description.couplings
        ),
        motors=tuple(map(new, description.motors)),
        home={new(name): q for name, q in description.home.items()},
    )


class Mounted(NamedTuple):
    """A mechanism, the link that its root is fixed to, and where."""

    description: Description
    link: str
    at: np.ndarray


def joined(name: str, parts: Sequence[Mounted]) -> Description:
    """Return one mechanism of several of different names; the first one's root is that of the whole."""
    mounts = [
        Joint(f"mount{i}", JointKind.FIXED, x.link, x.description.root, x.at, np.array([1.0, 0.0, 0.0]))
        for i, x in enumerate(parts)
    ]
    each = [x.description for x in parts]
    return Description(
        name,
        tuple(link for x in each for link in x.links),
        (*mounts[1:], *(joint for x in each for joint in x.joints)),
        tuple(closure for x in each for closure in x.closures),
        tuple(coupling for x in each for coupling in x.couplings),
        tuple(motor for x in each for motor in x.motors),
        "drawn",
        {joint: q for x in each for joint, q in x.home.items()},
    )
