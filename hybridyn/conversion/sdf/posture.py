"""Where the links of a robot stand in the posture that its SDF file states.

Loops have to be closed in that posture. A robot with closures therefore stands at home, and a tree at zero.
"""

from __future__ import annotations

import numpy as np

from ...description.placement import placement_from, rotation_from_quaternion
from ...description.records import Array, Description, Joint
from ...spatial import rotation_from_axis_angle


class Posture:
    """A posture of a robot.

    Attributes:
        positions: Joint positions by name, those that are not zero: one number [m or rad], or Pinocchio's
            coordinates of a joint with several freedoms.
        world: Pose of each link relative to the root link, shape (4, 4).
        step: Pose of each link relative to its parent link, shape (4, 4).
    """

    def __init__(self, d: Description) -> None:
        """Compute the posture.

        Args:
            d: The robot.
        """
        self.positions = {joint.name: x for joint in d.joints if d.closures and (x := _position(joint, d))}
        self.step = {joint.child: joint.placement @ self._motion(joint) for joint in d.joints}
        self.world = {d.root: np.eye(4)}
        above = {joint.child: joint.parent for joint in d.joints}
        for link in d.links:
            chain = [link.name]
            while chain[-1] not in self.world:
                chain.append(above[chain[-1]])
            for child, parent in zip(chain[-2::-1], chain[:0:-1], strict=True):
                self.world[child] = self.world[parent] @ self.step[child]

    def single(self, joint: str) -> float:
        """Return the position of a joint with one freedom [m or rad].

        Args:
            joint: Its name.
        """
        return self.positions.get(joint, (0.0,))[0]

    def _motion(self, joint: Joint) -> Array:
        """Return the motion of a joint from position zero, shape (4, 4)."""
        x = self.positions.get(joint.name, ())
        if not x:
            return np.eye(4)
        if joint.kind == "prismatic":
            return placement_from(np.eye(3), x[0] * joint.axis)
        if joint.kind in ("revolute", "continuous"):
            turn = rotation_from_axis_angle(joint.axis, np.array(np.cos(x[0])), np.array(np.sin(x[0])))
            return placement_from(turn, np.zeros(3))
        if joint.kind == "planar":
            turn = rotation_from_axis_angle(joint.axis, np.array(x[2]), np.array(x[3]))
            return placement_from(turn, np.array([x[0], x[1], 0.0]))
        qx, qy, qz, qw = x[-4:]
        position = np.array(x[:3]) if joint.kind == "floating" else np.zeros(3)
        return placement_from(rotation_from_quaternion(qx, qy, qz, qw), position)


def _position(joint: Joint, d: Description) -> tuple[float, ...]:
    """Return the home position of a joint, () for zero."""
    x = tuple(float(part) for part in d.home.get(joint.name, ()))
    if joint.kind == "continuous" and len(x) == 2:
        x = (float(np.arctan2(x[1], x[0])),)
    return x if any(x) else ()
