"""The model behind the node: it closes loops and computes efforts, compiled where this machine can."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from ..assembly.assemble import assemble
from ..assembly.posture import holding, positions_of
from ..assembly.task import closure_residual
from ..compiled import CompiledRobot, compile
from ..dynamics.inverse import idm
from ..effects.choice import choose
from ..effects.rebuild import with_effects
from ..errors import CompileError, ModelError
from ..simulation.events import near_singularity
from ..spatial import Array
from ..structure.bodies import Payload
from ..structure.building import rebuilt
from ..structure.robot import HybridRobot
from .joint_numbers import RosJoints, check_names

log = logging.getLogger("hybridyn.ros")

#: Sets of joints other than the motors whose models are kept: drivers have one or two.
SETS = 8
#: Positions, rates and accelerations of some joints, shape (3, n), and the last posture, (nq,), to q, v, a.
Closing = Callable[[Array, Array], tuple[Array, Array, Array]]


class RosModel:
    """A robot whose loops are closed and whose efforts are computed, message after message.

    Attributes:
        robot: The robot, with the payload's link held where a payload may change.
        joints: Its joints as ROS names them.
        outputs: Names of the output joints.
        undriven: Joints of the modules that have fewer motors than freedoms, such as a passive toe.
        compiled: Its compiled models; None where this machine cannot compile, or nothing is compiled.
    """

    def __init__(
        self,
        robot: HybridRobot,
        outputs: Sequence[str] = (),
        effects: Sequence[str] = ("default",),
        payload_link: str = "",
    ) -> None:
        """Compile a robot.

        Args:
            robot: The robot.
            outputs: Names of output joints, from which trajectories may come.
            effects: Names of the effects that count in efforts.
            payload_link: Link that carries the payload; "" for none.

        Raises:
            ModelError: An effect or the link is unknown.
            TrajectoryError: An output is no joint.
        """
        check_names(outputs, robot.joint_index)
        robot = holding(robot, outputs)
        names = [f"payload_{what}:{payload_link}" for what in ("mass", "centre")] if payload_link else []
        if payload_link:
            robot = with_effects(robot, [*effects, Payload(payload_link, 0.0)])
        self.robot, self.joints = robot, RosJoints(robot)
        self.outputs = tuple(outputs)
        self.undriven = frozenset(
            joint for m in robot.modules if len(m.motors) < m.mobility for joint in m.joints
        )
        self._effects, self._link = choose(robot, effects), payload_link
        self._payload: Array | None = None
        self._loaded = robot  # what the general path computes
        self.compiled = _compiled(robot, self._effects, names)
        self._closings: dict[tuple[str, ...], Closing] = {}
        self._singular = [near_singularity(robot, 0.0, what=what) for what in ("motors", "closures")]
        if robot.motors and not self.undriven:
            still = np.zeros((3, len(robot.motors)))
            still[0] = self.motor_positions(robot.home)
            self.closing(robot.motors)(still, robot.home)  # builds what closes

    def motor_positions(self, q: Array) -> Array:
        """Return the positions of the motors at a posture, shape (motors,), [m or rad]."""
        out: Array = positions_of(self.robot, q[None], self.robot.motors)[0]
        return out

    def closing(self, joints: Sequence[str]) -> Closing:
        """Return the function that closes the loops from some joints; that of the motors is ready.

        Raises:
            HybridynError: The joints cannot be coordinates of the robot.
        """
        key = tuple(joints)
        if key not in self._closings:
            own, robot, models = key == self.robot.motors, self.robot, self.compiled
            if not own:
                if len(others := [one for one in self._closings if one != self.robot.motors]) == SETS:
                    del self._closings[others[0]]
                robot = rebuilt(robot, replace(robot.description, motors=key), held={*robot.held, *key})
                models = models and _compiled(robot, None, [])
            self._closings[key] = partial(_close, robot, models)
        return self._closings[key]

    def along(
        self, motion: Mapping[str, Any], guess: Array, hold: Sequence[str]
    ) -> tuple[Array, Array, Array]:
        """Close the loops along a motion of joints, like `hybridyn.assemble`.

        Args:
            motion: Position, rate and acceleration by joint, shape (T,).
            guess: Posture before the motion, shape (nq,).
            hold: Joints that stay.
        """
        close = partial(assemble, self.robot) if self.compiled is None else self.compiled.assemble
        return close(motors=motion, guess=guess, hold=hold)

    def load(self, mass: float, centre: Sequence[float]) -> None:
        """Set the payload: its mass [kg] and its centre of mass, shape (3,), [m], in the frame of its link.

        Raises:
            ModelError: There is no link for it, or no body is like this.
        """
        if not self._link:
            raise ModelError("the payload has no link: set the parameter payload_link when the node starts")
        payload = Payload(self._link, mass, tuple(centre))
        numbers = np.array([payload.mass, *payload.com])
        if self.compiled is None:
            named = {f"payload_mass:{self._link}": numbers[0], f"payload_centre:{self._link}": numbers[1:]}
            self._loaded = self.robot.with_parameters(named)
        self._payload = numbers

    def efforts(self, q: Array, v: Array, a: Array) -> Array:
        """Compute the efforts of the motors, like `hybridyn.idm`, with the payload.

        Raises:
            HybridynError: As `hybridyn.idm`.
        """
        if self.compiled is None:
            return idm(self._loaded, q, v, a, effects=self._effects)
        out: Array = self.compiled.idm(q, v, a, parameters=self._payload)
        return out

    def residual(self, q: Array) -> float:
        """Return the largest closure residual of a posture, over the size of its module."""
        return float(closure_residual(self.robot, q))

    def distances(self, q: Array) -> tuple[float, float]:
        """Return how far a posture is from singular ones: least share of the motors, and of the closures.

        Both are from 0, at a singular posture, to 1 (`hybridyn.near_singularity`).
        """
        motors, closures = (event.function(0.0, q, np.zeros(self.robot.nv)) for event in self._singular)
        return motors, closures


def _close(
    robot: HybridRobot, models: CompiledRobot | None, motion: Array, last: Array
) -> tuple[Array, Array, Array]:
    """Close the loops from the motors of a robot."""
    if models is not None:
        return models.close(*motion, last=last)
    return assemble(robot, motors=tuple(motion), guess=last)


def _compiled(robot: HybridRobot, effects: Any, parameters: Sequence[str]) -> CompiledRobot | None:
    """Compile a robot; None, with a line in the log, where this machine cannot."""
    try:
        return compile(robot, effects, parameters=parameters)
    except CompileError as error:
        log.warning("the general path computes, in milliseconds: %s", error)
        return None
