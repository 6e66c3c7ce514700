"""Moving bodies without mass that stand for a real part, as against frames between the axes of one joint."""

from __future__ import annotations

from collections.abc import Container

import numpy as np

from .records import Array, Closure, Description, Joint

#: Axes of one joint meet within this part of the robot's largest offset: files keep five or six digits.
MEETING = 1e-5


def weightless(description: Description, shaped: Container[str] = ()) -> list[Joint]:
    """Return the joints that move a body without mass, where that body is a part of its own.

    A body is a link with all that fixed joints weld to it. It is no part but a frame where everything that it
    carries sits at its own joint: the crosses of universal and ball joints, the stages of a virtual leg.

    Args:
        description: What the files say.
        shaped: Links that have a shape: those are parts wherever their joints sit.

    Returns:
        Joints in file order.
    """
    bodies = Bodies(description)
    heavy = {bodies.of[link.name] for link in description.links if link.mass or link.inertia.any()}
    meeting = MEETING * max((float(np.abs(p).max()) for p in bodies.points()), default=0.0)
    carries: dict[str, list[Array]] = {}
    for body, point in bodies.carried():
        carries.setdefault(body, []).append(point)

    def farthest(body: str) -> float:
        return max((float(np.linalg.norm(point)) for point in carries.get(body, ())), default=np.inf)

    return [
        joint
        for joint in description.joints
        if joint.kind != "fixed"
        and joint.child not in heavy
        and (joint.child in shaped or farthest(joint.child) > meeting)
    ]


def has_mass(description: Description) -> bool:
    """Say whether anything that a joint moves, or the root, has mass, inertia or a rotor.

    Args:
        description: What the files say.
    """
    return any(link.mass or link.inertia.any() for link in description.links) or any(
        joint.rotor_inertia for joint in description.joints
    )


class Bodies:
    """Links welded together by fixed joints.

    Attributes:
        of: For each link the link that its body moves with: the child of the joint above, or the root.
        placement: For each link its frame in that link's, shape (4, 4).
    """

    def __init__(self, description: Description) -> None:
        """Weld the links of a description.

        Args:
            description: What the files say.
        """
        self._description = description
        above = {joint.child: joint for joint in description.joints}
        self.of: dict[str, str] = {}
        self.placement: dict[str, Array] = {}
        for link in description.links:
            chain = [link.name]
            while chain[-1] not in self.of and chain[-1] in above and above[chain[-1]].kind == "fixed":
                chain.append(above[chain[-1]].parent)
            for name in reversed(chain):
                joint = above.get(name)
                welded = joint is not None and joint.kind == "fixed"
                if joint is not None and welded:
                    self.of[name] = self.of[joint.parent]
                    self.placement[name] = self.placement[joint.parent] @ joint.placement
                else:
                    self.of[name], self.placement[name] = name, np.eye(4)

    def carried(self) -> list[tuple[str, Array]]:
        """Give every movable joint and closure that a body carries: the body, and the place in its frame."""
        out = [
            (self.of[joint.parent], (self.placement[joint.parent] @ joint.placement)[:3, 3])
            for joint in self._description.joints
            if joint.kind != "fixed"
        ]
        return [*out, *(end for closure in self._description.closures for end in self._ends(closure))]

    def _ends(self, closure: Closure) -> list[tuple[str, Array]]:
        pairs = ((closure.link_a, closure.frame_a), (closure.link_b, closure.frame_b))
        return [(self.of[link], (self.placement[link] @ frame)[:3, 3]) for link, frame in pairs]

    def points(self) -> list[Array]:
        """Return the place of everything that bodies carry, each in its body's frame."""
        return [point for _, point in self.carried()]
