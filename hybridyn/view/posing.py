"""Moving one motor by hand: the loops stay closed, and a motor stops where they would not.

A drag gives the position of one joint. The others that fix its module's posture keep theirs: the other
motors, of which redundant ones yield, and passive joints where motors are too few.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..assembly.assemble import move_module
from ..errors import AssemblyError, HybridynError
from ..spatial import Array
from ..structure.module import Module
from ..structure.robot import HybridRobot

#: Of the way to a place out of reach, to find where the reach ends.
HALVINGS = 6
#: Share of a joint in motions that the joints before it leave: less fixes nothing.
LEAST_SHARE = 1e-3
#: Of the module's length: a slide without limits goes this far from home.
STROKE = 1.0
#: A hinge without limits turns this far from home [rad].
TURN = np.pi
DRAGGED = ("revolute", "continuous", "prismatic")


@dataclass(frozen=True)
class Lever:
    """A joint that can be moved by hand.

    Attributes:
        joint: Its name.
        module: Number of its module.
        low: Lowest position [m or rad].
        high: Highest position [m or rad].
        unit: "m" or "rad".
        is_motor: Whether it is a motor; robots without motors have other joints moved.
    """

    joint: str
    module: int
    low: float
    high: float
    unit: str
    is_motor: bool


@dataclass(frozen=True)
class Moved:
    """What came of a move.

    Attributes:
        q: The posture, shape (nq,).
        value: Position of the joint there [m or rad].
        message: What stopped it, or an empty text.
    """

    q: Array
    value: float
    message: str = ""


class Poser:
    """The posture of a robot in somebody's hands.

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
        """Return the position of a joint with one freedom, an angle in (-pi, pi] where it has no limits."""
        at = self.robot.q_slices[self.robot.joint_index[joint]]
        if self._kind(joint) == "continuous":
            return float(np.arctan2(q[at.start + 1], q[at.start]))
        return float(q[at.start])

    def move(self, q: Array, joint: str, value: float) -> Moved:
        """Move one joint towards a position, as far as the loops close.

        Args:
            q: The posture now, shape (nq,).
            joint: The joint.
            value: Where it shall go [m or rad].

        Returns:
            The posture reached; a message where that is not all the way.
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
            f"{joint} stops at {at:.4g} {lever.unit}: further on the loops of {module.name} do not close",
        )

    def _kind(self, joint: str) -> str:
        return self.robot.kinds[self.robot.joint_index[joint]]

    def _close(self, q: Array, lever: Lever, value: float) -> Array:
        """Close the loops with a joint at a position.

        Raises:
            HybridynError: It is out of reach.
        """
        if lever.joint not in self._others:
            self._others[lever.joint] = self._found_others(q, lever)
        joints = {name: self.value(q, name) for name in self._others[lever.joint]} | {lever.joint: value}
        return move_module(self.robot, lever.module, joints, q)

    def _found_others(self, q: Array, lever: Lever) -> tuple[str, ...]:
        """Return the joints whose positions, with that of one joint, fix its module's posture."""
        module = self.robot.modules[lever.module]
        first = lever.joint
        motors = [name for name in module.motors if name != first and self._kind(name) in DRAGGED]
        chosen = independent(module, [first, *motors])
        try:  # rods that spin need nobody to hold them
            move_module(self.robot, lever.module, {name: self.value(q, name) for name in chosen}, q)
        except AssemblyError as error:
            if not error.open_freedoms:
                raise
            tree = [module.joints[i] for i in module.mechanism.spec.tree_joint if i is not None]
            passive = [name for name in tree if self._kind(name) in DRAGGED and name not in (first, *motors)]
            chosen = independent(module, [first, *motors, *passive])
        return tuple(name for name in chosen if name != first)

    def _independent_joints(self) -> list[str]:
        """Return joints that fix the posture of a robot without motors."""
        out: list[str] = []
        for module in self.robot.modules:
            tree = [module.joints[i] for i in module.mechanism.spec.tree_joint if i is not None]
            known = [name for name in tree if name in self.robot.joint_index and self._kind(name) in DRAGGED]
            out += independent(module, known)
        return out

    def _lever(self, joint: str) -> Lever:
        """Return a joint's range: its limits, or a turn or a stroke about home where it has none."""
        number = next(k for k, module in enumerate(self.robot.modules) if joint in module.joints)
        record = next(j for j in self.robot.description.joints if j.name == joint)
        home = self.value(self.robot.home, joint)
        slides = record.kind == "prismatic"
        span = STROKE * float(self.robot.modules[number].mechanism.length) if slides else TURN
        if record.kind == "continuous":
            return Lever(joint, number, -TURN, TURN, "rad", joint in self.robot.motors)
        low = record.lower if np.isfinite(record.lower) else home - span
        high = record.upper if np.isfinite(record.upper) else home + span
        if not low < high:  # limits of 0 and 0 are a way of saying none
            low, high = home - span, home + span
        unit = "m" if slides else "rad"
        return Lever(joint, number, min(low, home), max(high, home), unit, joint in self.robot.motors)


def independent(module: Module, joints: Sequence[str]) -> list[str]:
    """Choose, in their order, the joints whose positions are independent, judged at a generic posture.

    Args:
        module: The module.
        joints: Joints of its tree with one freedom each.

    Returns:
        At most as many as the module has freedoms.
    """
    m = module.mechanism
    motion = m.tree.sweep(m.postures[:1])
    Psi = m.basis(m.closures.matrix(motion)).Psi[0] / m.reduction.col_scale[:, None]
    if not Psi.shape[1]:
        return []
    left = np.linalg.qr(Psi)[0]  # what each freedom does in motions that no chosen joint fixes
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
