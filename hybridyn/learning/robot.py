"""`LearningRobot`: the models of a robot on arrays of a learning framework, differentiable."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..compiled import CompiledRobot
from ..spatial import Array
from ..structure.robot import HybridRobot
from .charts import Charts
from .framework import Framework
from .functions import SmoothFunction
from .joint_sides import JointSides


class LearningRobot:
    """Models of one robot for a learning framework, with exact derivatives of first and second order.

    Arguments are arrays of the framework in double precision, shape (..., n): a sample, or samples with any
    leading axes, which are broadcast. Gradients over q are over its numbers as they stand; quaternions, and
    cosines with sines, count for their direction alone, so that their gradients have no part along them.

    Derivatives of `idm` and `ddm` over q and v hold along motions that keep the loops closed, as those of
    `hybridyn.idm_jacobian`: let q, v, a come from `close`, on a floating base beside its own pose and rates.
    Numbers of the robot are constants: `hybridyn.DesignGradients` differentiates by them.

    Attributes:
        robot: The robot.
        compiled: Its compiled models.
    """

    def __init__(
        self, compiled: CompiledRobot, framework: Framework, functions: Mapping[str, SmoothFunction]
    ) -> None:
        """Take models; their derivatives are written and built at their first use.

        Args:
            compiled: The compiled models.
            framework: The framework.
            functions: "idm", "ddm" and "close" of the arrays on which it calls them.
        """
        self.robot, self.compiled, self._framework = compiled.robot, compiled, framework
        self._charts = Charts(self.robot, framework.xp, lambda x: framework.array("", x, x.shape[-1]))
        self._idm, self._ddm, self._close = (functions[name] for name in ("idm", "ddm", "close"))
        self._in_loops = [framework.array("", x, len(x)) for x in _in_loops(self.robot)]

    def idm(self, q: Any, v: Any, a: Any) -> Any:
        """Compute motor efforts, like `hybridyn.idm`.

        Args:
            q: Positions of closed loops, shape (..., nq).
            v: Rates, shape (..., nv), [m/s, rad/s].
            a: Accelerations, shape (..., nv), [m/s^2, rad/s^2].

        Returns:
            Efforts in the order of `robot.motors`, shape (..., motors), [N or N m].

        Raises:
            HybridynError: An array is wrong, or as `hybridyn.idm` raises.
        """
        return self._model(self._idm, q=q, v=v, a=a)

    def ddm(self, q: Any, v: Any, tau: Any) -> Any:
        """Compute accelerations, like `hybridyn.ddm`.

        Args:
            q: Positions of closed loops, shape (..., nq).
            v: Rates, shape (..., nv), [m/s, rad/s].
            tau: Efforts in the order of `robot.motors`, shape (..., motors), [N or N m].

        Returns:
            Accelerations of the spanning tree, shape (..., nv), [m/s^2, rad/s^2].

        Raises:
            HybridynError: An array is wrong, or as `hybridyn.ddm` raises.
        """
        return self._model(self._ddm, q=q, v=v, tau=tau)

    def close(
        self, position: Any, rate: Any = None, acceleration: Any = None, *, near: Any = None
    ) -> tuple[Any, Any, Any]:
        """Compute the motion of all joints from the motors', like `CompiledRobot.close` for each sample.

        Args:
            position: Positions in the order of `robot.motors`, shape (..., motors), [m or rad].
            rate: Their rates, likewise; zero by default.
            acceleration: Their accelerations, likewise; zero by default.
            near: Closed postures, shape (..., nq), from which the motors move straight to `position` on the
                same assembly branch; the home posture by default. They carry no gradient. A base, and joints
                that no motor moves, stay as they are there.

        Returns:
            q, v, a on the spanning tree, shapes (..., nq), (..., nv), (..., nv).

        Raises:
            HybridynError: An array is wrong, or as `hybridyn.assemble` raises.
            ModelError: The motors of a module with loops are not its independent coordinates.
        """
        (nq, motors, *_), nv = self._close.sizes, self.robot.nv
        start = self._framework.still("near", self.robot.home if near is None else near, nq)
        position = self._framework.array("position", position, motors)
        given = [
            0.0 * position if x is None else self._framework.array(name, x, motors)
            for name, x in (("rate", rate), ("acceleration", acceleration))
        ]
        motion = self._framework.apply(self._close, start, position, *given)
        return motion[..., :nq], motion[..., nq : nq + nv], motion[..., nq + nv :]

    def step(self, q: Any, v: Any, tau: Any, h: Any) -> tuple[Any, Any]:
        """Take one step of Runge-Kutta's method of order four on the closed loops, under constant efforts.

        At each stage the loops follow the motors; a floating base, and joints outside loops, move freely.

        Args:
            q: Positions of closed loops, shape (..., nq).
            v: Rates that keep them closed, shape (..., nv), [m/s, rad/s].
            tau: Efforts in the order of `robot.motors`, shape (..., motors), [N or N m].
            h: Length of the step [s], a number or an array that broadcasts with q.

        Returns:
            q, v after the step, shapes (..., nq), (..., nv).

        Raises:
            HybridynError: As `close` and `ddm` raise.
        """
        take = self._framework.array
        q, v = take("q", q, self.robot.nq), take("v", v, self.robot.nv)
        near, q_dot, v_dot = self._framework.constant(self._charts.normalized(q)), [0.0 * q], [0.0 * v]
        for part in (0.0, 0.5, 0.5, 1.0):
            x, u = self._closed(q + part * h * q_dot[-1], v + part * h * v_dot[-1], near)
            q_dot.append(self._charts.rate(x, u))
            v_dot.append(self.ddm(x, u, tau))
        q, v = (
            x + h / 6.0 * (first + 2.0 * (second + third) + fourth)
            for x, (_, first, second, third, fourth) in ((q, q_dot), (v, v_dot))
        )
        return self._closed(q, v, near)

    def joint_map(self, joints: Sequence[str]) -> JointSides:
        """Return the map between output joints and motors, as of a parallel ankle, see `hybridyn.joint_map`.

        Args:
            joints: Names of the output joints, as many in each of their modules as it has motors.

        Raises:
            HybridynError: The joints do not fit their modules.
        """
        return JointSides(self.compiled, tuple(joints), self._framework, self._charts, self.close)

    def _model(self, function: SmoothFunction, **given: Any) -> Any:
        """Compute a model at positions, rates, and accelerations or efforts."""
        q, v, x = (
            self._framework.array(name, array, width)
            for (name, array), width in zip(
                given.items(), (function.sizes[0], *function.sizes[2:4]), strict=True
            )
        )
        q = self._charts.normalized(q)
        near = self._framework.constant(q)
        return self._framework.apply(function, near, self._charts.displacement(near, q), v, x)

    def _closed(self, q: Any, v: Any, near: Any) -> tuple[Any, Any]:
        """Return positions and rates where loops follow the motors, and all else stays."""
        robot, q = self.robot, self._charts.normalized(q)
        closed = self.close(self._charts.angles(q, robot.motors), v[..., robot.motor_v], near=near)
        x, u = (
            inside * found + (1.0 - inside) * free
            for inside, found, free in zip(self._in_loops, closed, (q, v), strict=False)
        )
        return x, u


def _in_loops(robot: HybridRobot) -> list[Array]:
    """Return for each entry of q, and of v, 1 if its joint lies in a module with loops, and 0 elsewhere."""
    out = [np.zeros(robot.nq), np.zeros(robot.nv)]
    for module in robot.modules:
        if module.mechanism.spanning_closures.rows:
            out[0][module.q_index], out[1][module.v_index] = 1.0, 1.0
    return out
