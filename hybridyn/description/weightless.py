"""Find massless moving bodies that represent a real part, not only a frame between the axes of one joint."""

from __future__ import annotations

from collections.abc import Container

import numpy as np

from .placement import outwards
from .records import Array, Description, Joint

#: Axes meet if they are closer than this fraction of the robot's largest offset: files keep 5 or 6 digits.
MEETING = 1e-5


def weightless(description: Description, shaped: Container[str] = ()) -> list[Joint]:
    """Return the joints that move a massless body which represents a real part.

    A body is a link with all links that fixed joints weld to it. It is only a frame, not a part, if
    everything that it carries is placed at its own joint: the crosses of universal and ball joints, the
    stages of a virtual leg. Links that a reader made between the joints of one body are frames, too.

    Args:
        description: The description of the robot.
        shaped: Links that have a shape; they are parts wherever their joints are placed.
    """
    bodies = Bodies(description)
    exempt = {bodies.of[link.name] for link in description.links if link.mass or link.inertia.any()}
    exempt |= {link.name for link in description.links if link.between_joints}
    meeting = MEETING * max((float(np.abs(point).max()) for _, point in bodies.carried()), default=0.0)
    farthest: dict[str, float] = {}
    for body, point in bodies.carried():
        farthest[body] = max(farthest.get(body, 0.0), float(np.linalg.norm(point)))
    return [
        joint
        for joint in description.joints
        if joint.kind != "fixed"
        and joint.child not in exempt
        and (joint.child in shaped or farthest.get(joint.child, np.inf) > meeting)
    ]


def has_mass(description: Description) -> bool:
    """Check whether any link has mass or inertia, or any joint has rotor inertia."""
    return any(link.mass or link.inertia.any() for link in description.links) or any(
        joint.rotor_inertia for joint in description.joints
    )


class Bodies:
    """Rigid bodies: links welded together by fixed joints.

    A body has the name of its first link: the child of the movable joint above it, or the root.

    Attributes:
        of: Name of the body of each link.
        placement: Frame of each link in the frame of its body, shape (4, 4).
    """

    def __init__(self, description: Description) -> None:
        self._description = description
        self.of = {description.root: description.root}
        self.placement: dict[str, Array] = {description.root: np.eye(4)}
        for joint in outwards(description.joints, [description.root]):
            welded = joint.kind == "fixed"
            self.of[joint.child] = self.of[joint.parent] if welded else joint.child
            self.placement[joint.child] = (
                self.placement[joint.parent] @ joint.placement if welded else np.eye(4)
            )

    def carried(self) -> list[tuple[str, Array]]:
        """Return a pair for each movable joint and closure end that a body carries.

        Returns:
            Pairs (name of the body, position in its frame, shape (3,), [m]).
        """
        at = [(joint.parent, joint.placement) for joint in self._description.joints if joint.kind != "fixed"]
        for closure in self._description.closures:
            at += [(closure.link_a, closure.frame_a), (closure.link_b, closure.frame_b)]
        return [(self.of[link], (self.placement[link] @ frame)[:3, 3]) for link, frame in at]
