"""Where the links of a robot stand in the posture that its SDF file states.

Loops have to be closed in that posture. A robot with closures therefore stands at home, and a tree at zero,
but for its free bodies: SDF states their home by where they stand.
"""

from __future__ import annotations

from ...description.records import Description, Joint
from ..home import angle_of, motion_of, poses_at


class Posture:
    """A posture of a robot.

    Attributes:
        positions: Joint positions by name, those that are not zero: one number [m or rad], or Pinocchio's
            coordinates of a joint with several freedoms.
        world: Pose of each link relative to the root link, shape (4, 4).
        step: Pose of each link relative to its parent link, shape (4, 4).
    """

    def __init__(self, d: Description) -> None:
        moved = [joint for joint in d.joints if d.closures or joint.kind == "floating"]
        self.positions = {joint.name: x for joint in moved if (x := _position(joint, d))}
        self.step = {joint.child: joint.placement @ motion_of(joint, self.positions) for joint in d.joints}
        self.world = poses_at(d, self.positions)

    def single(self, joint: str) -> float:
        """Return the position of a joint with one freedom [m or rad]."""
        return self.positions.get(joint, (0.0,))[0]


def _position(joint: Joint, d: Description) -> tuple[float, ...]:
    """Return the home position of a joint, () for zero."""
    x = tuple(float(part) for part in d.home.get(joint.name, ()))
    if joint.kind == "continuous" and len(x) == 2:
        x = (angle_of(x),)
    return x if any(x) else ()
