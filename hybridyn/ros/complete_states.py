"""Complete states: from what a driver measures of some joints to all joints, with all loops closed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ..errors import TrajectoryError
from ..spatial import Index
from .joint_numbers import JointNumbers, check_names
from .ros_model import Closing, RosModel


class _Source(NamedTuple):
    """What the names of a message mean.

    Attributes:
        names: The names.
        places: The place of each among all joints.
        chosen: Those that determine the posture.
        close: Closes the loops from these.
    """

    names: tuple[str, ...]
    places: Index
    chosen: Index
    close: Closing


class CompleteStates:
    """Completes states of one robot, one after the other, each from the posture before.

    Attributes:
        model: The model.
        q: Last right posture, shape (nq,); home at first.
        v: Its rates, shape (nv,), zero where none are measured.
        a: Its accelerations, shape (nv,), while those that determine the posture do not accelerate.
    """

    def __init__(self, model: RosModel, names: Mapping[str, str] | None = None) -> None:
        """Begin at home. `names`: the robot's joint by the name that a driver gives it, where it differs."""
        self.model, self._renamed = model, dict(names or {})
        self.q, self.v, self.a = model.robot.home, np.zeros(model.robot.nv), np.zeros(model.robot.nv)
        self._places = {name: i for i, name in enumerate(model.joints.names)}
        self._stamp = 0
        self._source: _Source | None = None  # of the last message: those of a driver are alike

    def complete(self, given: JointNumbers, stamp: int) -> JointNumbers:
        """Return the state of all joints; rates and efforts only where they are given.

        Where all motors are among the joints, they determine the posture of their modules, and positions and
        rates of other joints of these are not read; otherwise all the joints that are given determine it.
        Efforts are those that are given, and 0 of other joints.

        Args:
            given: The measured state.
            stamp: Its time [ns].

        Raises:
            HybridynError: The message is wrong, comes before the last one, or its positions do not close the
                loops on the assembly branch of the last posture. The last right state stays. After a message
                with an earlier time the clock may have started again: the next one is closed from home.
        """
        late, self._stamp = stamp < self._stamp, stamp
        if late:
            self.q = self.model.robot.home
            raise TrajectoryError("the time of the message is before that of the last one")
        if self._source is None or self._source.names != tuple(given.names):
            self._source = self._read(tuple(given.names))
        _, places, chosen, close = self._source
        position, velocity, effort = given.numbers(chosen)
        motion = np.zeros((3, len(chosen)))
        motion[0] = position
        if velocity is not None:
            motion[1] = velocity
        q, v, a = close(motion, self.q)
        self.q, self.v, self.a = q, v, a
        joints = self.model.joints
        every = None
        if effort is not None:
            every = np.zeros(len(joints.names))
            every[places] = effort
        return JointNumbers(
            joints.names, joints.positions(q), None if velocity is None else joints.rates(q, v), every
        )

    def _read(self, names: tuple[str, ...]) -> _Source:
        """Find what the names of a message mean.

        Raises:
            HybridynError: A name is unknown or stands twice, or the joints cannot determine a posture.
        """
        own = [self._renamed.get(name, name) for name in names]
        check_names(own, self._places)
        motors, joints = self.model.robot.motors, own
        if motors and set(motors) <= set(own):
            joints = [*motors, *(x for x in own if x in self.model.undriven and x not in motors)]
        chosen = np.array([own.index(name) for name in joints], dtype=int)
        return _Source(names, np.array([self._places[x] for x in own]), chosen, self.model.closing(joints))
