"""Define what an engine does in a comparison, and the map between its coordinates and the robot's.

Only rigid bodies are compared: gravity, inertia and closures. Friction, damping, springs, rotors, contacts
and limits are switched off in every engine.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ...description.names import listed
from ...errors import HybridynError
from ...spatial import Array, Index
from ...structure.robot import HybridRobot, joint_position

#: Kinds of joint with one coordinate that a name and a position describe in every engine.
SINGLE = ("revolute", "continuous", "prismatic")


class NotComparableError(HybridynError):
    """An engine refuses the robot, or makes another robot of it; the message says what."""


class Engine(Protocol):
    """A robot inside another engine, in the robot's own coordinates.

    Attributes:
        way: How the robot came into the engine, in words.
        step: Time step of its simulation [s].
        notes: Remarks.
    """

    way: str
    step: float
    notes: tuple[str, ...]

    def forward(self, q: Array, v: Array, force: Array) -> Array:
        """Compute the accelerations, shape (nv,), under generalised forces on all joints, shape (nv,)."""
        ...

    def inverse(self, q: Array, v: Array, a: Array) -> Array | None:
        """Compute the generalised forces that move the tree without its closures, shape (nv,).

        None if the engine has no inverse dynamics.
        """
        ...

    def freedoms(self, q: Array) -> int | None:
        """Count the freedoms that the engine's constraints leave at a posture; None if it does not say."""
        ...

    def call(self, q: Array, v: Array, force: Array) -> Callable[[], object]:
        """Return the engine's own direct dynamics at one state, without conversions, to be timed."""
        ...

    def run(self, q: Array, seconds: float) -> list[Array]:
        """Simulate from rest without efforts, and return postures over time, each of shape (nq,)."""
        ...


#: A way of a robot into an engine: in words, and the function that goes it.
Way = tuple[str, Callable[[], Engine]]


@dataclass(frozen=True, eq=False)
class SingleJoints:
    """The map between the coordinates of an engine whose joints have one freedom each, and the robot's.

    Attributes:
        q_at: Index in the engine's positions of each joint of the robot, shape (joints,).
        v_at: Index in the engine's velocities, shape (joints,).
    """

    robot: HybridRobot
    q_at: Index
    v_at: Index

    @property
    def own(self) -> Index:
        """Index in the robot's v of each joint, shape (joints,)."""
        return np.array([at.start for at in self.robot.v_slices], dtype=int)

    def positions(self, q: Array, size: int) -> Array:
        """Return the engine's positions, shape (size,)."""
        out = np.zeros(size)
        for at, name in zip(self.q_at, self.robot.joints, strict=True):
            out[at] = joint_position(self.robot, q, name)
        return out

    def back(self, x: Array) -> Array:
        """Return the robot's positions, shape (nq,)."""
        out = np.zeros(self.robot.nq)
        for at, kind, own in zip(self.q_at, self.robot.kinds, self.robot.q_slices, strict=True):
            out[own] = [np.cos(x[at]), np.sin(x[at])] if kind == "continuous" else x[at]
        return out

    def rates(self, v: Array, size: int) -> Array:
        """Return the engine's velocities or forces, shape (size,)."""
        out = np.zeros(size)
        out[self.v_at] = v[self.own]
        return out

    def rates_back(self, x: Array) -> Array:
        """Return the robot's velocities, accelerations or forces, shape (nv,)."""
        out = np.zeros(self.robot.nv)
        out[self.own] = np.asarray(x, dtype=float)[self.v_at]
        return out


def refuse_other_joints(robot: HybridRobot, theirs: Sequence[str], engine: str) -> None:
    """Raise if the joints of an engine are not those of the robot.

    Raises:
        NotComparableError: Joints are missing, or there are others.
    """
    missing = [name for name in robot.joints if name not in theirs]
    more = [name for name in theirs if name not in robot.joints]
    if missing or more:
        parts = [f"without joints {listed(missing)}"] if missing else []
        parts += [f"with joints {listed(more)}"] if more else []
        raise NotComparableError(f"{engine} makes another robot of it: {' and '.join(parts)}")


def refuse_several_freedoms(robot: HybridRobot, engine: str) -> None:
    """Raise for joints with several freedoms, which the engine's map does not have.

    Raises:
        NotComparableError: There is such a joint.
    """
    wide = [name for name, kind in zip(robot.joints, robot.kinds, strict=True) if kind not in SINGLE]
    if wide:
        raise NotComparableError(f"{engine} is compared for joints with one freedom, not for {listed(wide)}")
