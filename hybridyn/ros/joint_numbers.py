"""What messages of ROS hold of joints, as arrays: a state, a trajectory; and the joints as ROS names them.

ROS knows joints with one number. A joint with several freedoms is the chain of hinges and slides that
`convert --ros` writes for it (`JointKind.parts`), and its numbers are those of the chain.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..conversion.parts import hinge_angles, hinge_rates
from ..description.names import did_you_mean
from ..errors import TrajectoryError
from ..joints.kinds import JointKind, Turn
from ..linkage.joints import ROOT_JOINT
from ..spatial import Array, Index, rotation_from_quaternion
from ..structure.robot import HybridRobot

EVERY = slice(None)


class JointNumbers(NamedTuple):
    """A state of joints, as `sensor_msgs/JointState` holds it.

    Attributes:
        names: Names of the joints.
        position: Positions, shape (n,), [m or rad].
        velocity: Rates, shape (n,), [m/s or rad/s]; None or empty where the message has none.
        effort: Efforts, shape (n,), [N or N m]; likewise.
    """

    names: Sequence[str]
    position: ArrayLike
    velocity: ArrayLike | None = None
    effort: ArrayLike | None = None

    def numbers(self, read: Index) -> tuple[Array, Array | None, Array | None]:
        """Return positions and rates of the joints that are read, and efforts of all joints.

        Rates that are all NaN are none, and an effort that is NaN is 0: drivers write so what they do not
        measure.

        Args:
            read: The places of the joints that are read.

        Raises:
            TrajectoryError: An array has another length than the names, or a number is not finite.
        """
        position = checked_numbers(self.names, self.position, "positions", read)
        velocity, effort = (
            None if x is None or np.isnan(x).all() else np.asarray(x, dtype=float)  # all of none, too
            for x in (self.velocity, self.effort)
        )
        if velocity is not None:
            velocity = checked_numbers(self.names, velocity, "velocities", read)
        if effort is not None:
            effort = checked_numbers(self.names, np.where(np.isnan(effort), 0.0, effort), "efforts")
        return position, velocity, effort


def check_names(names: Sequence[str], known: Collection[str]) -> None:
    """Check that names are those of joints, each once.

    Raises:
        TrajectoryError: They are not.
    """
    for name in names:
        if name not in known:
            raise TrajectoryError(f"there is no joint '{name}'{did_you_mean(name, known)}")
    if len(set(names)) < len(names):
        twice = next(name for name in names if list(names).count(name) > 1)
        raise TrajectoryError(f"joint '{twice}' is named twice")


def checked_numbers(
    names: Sequence[str], numbers: ArrayLike, what: str, read: Index | slice = EVERY
) -> Array:
    """Return numbers of joints, of which the array has one for each name.

    Args:
        names: The names.
        numbers: The array.
        what: What they are, for messages.
        read: The places of those that are returned, and must be finite.

    Raises:
        TrajectoryError: They are more or fewer, or one is not finite.
    """
    x = np.asarray(numbers, dtype=float)
    if x.shape != (len(names),):
        raise TrajectoryError(f"there are {x.size} {what} of {len(names)} joints")
    x = x[read]
    if not np.isfinite(x).all():
        wrong = int(np.argmin(np.isfinite(x)))
        name = np.array(names)[read][wrong]
        raise TrajectoryError(f"{x[wrong]} is among the {what}, of joint '{name}'")
    return x


class RosJoints:
    """The joints of a robot as ROS names them, and their numbers at states of the robot.

    Attributes:
        names: The names, in the order of the robot's joints; a base that moves is not among them.
    """

    def __init__(self, robot: HybridRobot) -> None:
        names, plain, others = list[str](), list[tuple[int, int, int]](), list[SeveralNumbers]()
        for name, kind, q, v in zip(robot.joints, robot.kinds, robot.q_slices, robot.v_slices, strict=True):
            if name == ROOT_JOINT:
                continue
            own = ros_names(name, kind)
            if kind.additive and kind is not JointKind.SCREW:
                plain.append((len(names), q.start, v.start))
            else:
                place = slice(len(names), len(names) + len(own))
                others.append(SeveralNumbers(kind, place, q, v, robot.records[name].pitch))
            names += own
        self.names = tuple(names)
        self._to, self._q, self._v = np.array(plain, dtype=int).reshape(-1, 3).T
        self._others = others

    def positions(self, q: Array) -> Array:
        """Return the positions at a posture, shape (names,), [m or rad]; `q`: shape (nq,)."""
        out = np.empty(len(self.names))
        out[self._to] = q[self._q]
        for joint in self._others:
            out[joint.place] = joint.position(q[joint.q])
        return out

    def rates(self, q: Array, v: Array) -> Array:
        """Return the rates of a state, shape (names,), [m/s or rad/s]; `q`: shape (nq,), `v`: (nv,)."""
        out = np.empty(len(self.names))
        out[self._to] = v[self._v]
        for joint in self._others:
            out[joint.place] = joint.rate(q[joint.q], v[joint.v])
        return out


class SeveralNumbers(NamedTuple):
    """A joint whose numbers in ROS are not its coordinates: its places there, in q and in v."""

    kind: JointKind
    place: slice
    q: slice
    v: slice
    pitch: float

    def position(self, q: Array) -> Array:
        """Return its numbers from its coordinates."""
        if self.kind is JointKind.SCREW:
            return np.array([q[0], self.pitch * q[0]])
        shift, turned = q[: self.kind.shift], q[self.kind.shift :]
        if self.kind.turn is Turn.BALL:
            return np.concatenate([shift, hinge_angles(turned)])
        return np.append(shift, np.arctan2(turned[1], turned[0]))

    def rate(self, q: Array, v: Array) -> Array:
        """Return the rates of its numbers; v is the child's twist in its own axes."""
        if self.kind is JointKind.SCREW:
            return np.array([v[0], self.pitch * v[0]])
        n = self.kind.shift
        if self.kind.turn is Turn.BALL:
            return np.concatenate(
                [rotation_from_quaternion(q[n:])[:n, :n] @ v[:n], hinge_rates(q[n:], v[n:])]
            )
        if not n:
            return v
        c, s = q[n:]
        return np.array([c * v[0] - s * v[1], s * v[0] + c * v[1], v[2]])


def ros_names(name: str, kind: JointKind) -> list[str]:
    """Return the names under which ROS knows a joint."""
    if kind is JointKind.SCREW:
        return [name, f"{name}_slide"]
    return [*_endings(name, kind)]


def _endings(name: str, kind: JointKind) -> Iterator[str]:
    """Yield the names of the parts of a joint, and of their parts."""
    if kind.single:
        yield name
        return
    for ending, part in kind.parts.items():
        yield from _endings(name + ending, part)
