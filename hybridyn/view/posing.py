"""Move one motor by hand while the loops stay closed; the motor stops where they can no longer close.

A drag sets the position of one joint. The other joints that determine its module's posture keep their
positions: the other motors, except redundant ones, and passive joints if there are too few motors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..assembly.assemble import move_module
from ..errors import AssemblyError, HybridynError
from ..spatial import Array
from ..structure.module import Module
from ..structure.robot import HybridRobot, joint_position

#: Number of bisections that find the last reachable position on the way to one out of reach.
HALVINGS = 6
#: Smallest part of a joint in the motions that the joints before it leave free. A smaller part is rounding.
LEAST_SHARE = 1e-3
#: Range of a slide without limits to either side of home, relative to the module's length.
STROKE = 1.0
#: Range of a hinge without limits to either side of home [rad].
TURN = np.pi
#: Kinds of joints that can be moved.
DRAGGED = ("revolute", "continuous", "prismatic")


@dataclass(frozen=True)
class Lever:
    """A joint that can be moved by hand.

    Attributes:
        module: Number of its module.
        low: Lowest position [m or rad].
        high: Highest position [m or rad].
        unit: "m" or "rad".
    """

    joint: str
    module: int
    low: float
    high: float
    unit: str


@dataclass(frozen=True, eq=False)
class Moved:
    """Result of a move.

    Attributes:
        q: The posture reached, shape (nq,).
        value: Position of the joint reached [m or rad].
        message: Why the joint stopped early, or an empty text.
    """

    q: Array
    value: float
    message: str = ""


class Poser:
    """Moves single joints of a robot.

    Attributes:
        robot: The robot.
        levers: The joints that can be moved.
    """

    def __init__(self, robot: HybridRobot) -> None:
        self.robot = robot
        movable = [name for name in robot.motors if self._kind(name) in DRAGGED]
        joints = movable or [*self._independent_joints()]
        self.levers = tuple(self._lever(name) for name in joints)
        self._others: dict[str, tuple[str, ...]] = {}

    def value(self, q: Array, joint: str) -> float:
        """Return the position of a joint [m or rad]; for a continuous joint the angle in [-pi, pi]."""
        return float(joint_position(self.robot, q, joint))

    def move(self, q: Array, joint: str, value: float) -> Moved:
        """Move one joint towards a position, as far as the loops close.

        Args:
            q: The current posture, shape (nq,).
            value: Requested position [m or rad].

        Returns:
            The posture reached, with a message if the joint stopped before the requested position.
        """
        lever = next(lever for lever in self.levers if lever.joint == joint)
        start = self.value(q, joint)
        way = value - start
        if self._kind(joint) == "continuous":
            way = float((way + np.pi) % (2 * np.pi) - np.pi)
        try:
            return Moved(self._close(q, lever, start + way), value)
        except HybridynError:
            pass
        reached, done = q, 0.0
        low, high = 0.0, 1.0
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            try:
                reached, done = self._close(reached, lever, start + middle * way), middle
                low = middle
            except HybridynError:
                high = middle
        at = start + done * way
        module = self.robot.modules[lever.module]
        return Moved(
            reached,
            at,
            f"{joint} stops at {at:.4g} {lever.unit}: beyond this, the loops of {module.name} do not close",
        )

    def _kind(self, joint: str) -> str:
        return self.robot.kinds[self.robot.joint_index[joint]]

    def _close(self, q: Array, lever: Lever, value: float) -> Array:
        """Close the loops with a joint at a position, starting from posture `q`.

        Raises:
            HybridynError: The position is out of reach.
        """
        if lever.joint not in self._others:
            self._others[lever.joint] = self._find_others(q, lever)
        joints = {name: self.value(q, name) for name in self._others[lever.joint]} | {lever.joint: value}
        return move_module(self.robot, lever.module, joints, q)

    def _find_others(self, q: Array, lever: Lever) -> tuple[str, ...]:
        """Return the joints whose positions, together with that of the lever, determine the posture."""
        module = self.robot.modules[lever.module]
        first = lever.joint
        motors = [name for name in module.motors if name != first and self._kind(name) in DRAGGED]
        chosen = independent(module, [first, *motors])
        try:  # spinning rods need no further joint
            move_module(self.robot, lever.module, {name: self.value(q, name) for name in chosen}, q)
        except AssemblyError as error:
            if not error.open_freedoms:
                raise
            tree = [module.joints[i] for i in module.mechanism.spec.tree_joint if i is not None]
            passive = [name for name in tree if self._kind(name) in DRAGGED and name not in (first, *motors)]
            chosen = independent(module, [first, *motors, *passive])
        return tuple(name for name in chosen if name != first)

    def _independent_joints(self) -> list[str]:
        """Return joints whose positions determine the posture of a robot without motors."""
        out: list[str] = []
        for module in self.robot.modules:
            tree = [module.joints[i] for i in module.mechanism.spec.tree_joint if i is not None]
            known = [name for name in tree if name in self.robot.joint_index and self._kind(name) in DRAGGED]
            out += independent(module, known)
        return out

    def _lever(self, joint: str) -> Lever:
        """Build the lever of a joint; without limits its range is `TURN` or `STROKE` about home."""
        number = next(k for k, module in enumerate(self.robot.modules) if joint in module.joints)
        record = self.robot.records[joint]
        home = self.value(self.robot.home, joint)
        slides = record.kind == "prismatic"
        span = STROKE * float(self.robot.modules[number].mechanism.length) if slides else TURN
        if record.kind == "continuous":
            return Lever(joint, number, -TURN, TURN, "rad")
        low = record.lower if np.isfinite(record.lower) else home - span
        high = record.upper if np.isfinite(record.upper) else home + span
        if not low < high:  # exporters write limits of 0 and 0 for none
            low, high = home - span, home + span
        unit = "m" if slides else "rad"
        return Lever(joint, number, min(low, home), max(high, home), unit)


def independent(module: Module, joints: Sequence[str]) -> list[str]:
    """Choose joints with independent positions, in the given order, at a generic posture.

    Args:
        joints: Joints of its tree with one freedom each.

    Returns:
        The chosen joints, at most as many as the module has freedoms.
    """
    m = module.mechanism
    motion = m.tree.sweep(m.postures[:1])
    Psi = m.basis(m.closures.matrix(motion)).Psi[0] / m.reduction.col_scale[:, None]
    if not Psi.shape[1]:
        return []
    left = np.linalg.qr(Psi)[0]  # motions that no chosen joint determines
    tree = {source: i for i, source in enumerate(m.spec.tree_joint) if source is not None}
    chosen: list[str] = []
    for joint in joints:
        number = module.joints.index(joint)
        if number not in tree or len(chosen) == Psi.shape[1]:
            continue
        row = left[m.tree.v_slices[tree[number]].start]
        size = float(np.linalg.norm(row))
        if size > LEAST_SHARE:
            unit = row / size
            left = left - np.outer(left @ unit, unit)
            chosen.append(joint)
    return chosen
