"""Robots without loops: `pin.rnea` and `pin.aba`."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin

from benchmarks.methods import Method, NotMeasuredError, Setting, Solver
from benchmarks.peers.pinocchio_loops import MOST, tree
from hybridyn import HybridRobot
from hybridyn.spatial import Array


def _tree(robot: HybridRobot) -> pin.Model:
    """Return the model of a robot without loops.

    Raises:
        NotMeasuredError: It has loops.
    """
    if robot.description.closures:
        raise NotMeasuredError("it has loops")
    return tree(robot)


def aba(robot: HybridRobot) -> Callable[[Setting], Solver]:
    """Prepare the direct model."""
    model, motors = _tree(robot), robot.motor_v
    data = model.createData()

    def solve(q: Array, v: Array, tau: Array) -> Array:
        Q = np.zeros(model.nv)
        Q[motors] = tau
        a: Array = pin.aba(model, data, q, v, Q)
        return a.copy()

    return lambda setting: solve


def rnea(robot: HybridRobot) -> Callable[[Setting], Solver]:
    """Prepare the inverse model."""
    model, motors = _tree(robot), robot.motor_v
    data = model.createData()

    def solve(q: Array, v: Array, a: Array) -> Array:
        out: Array = pin.rnea(model, data, q, v, a)[motors]
        return out

    return lambda setting: solve


METHODS = (Method("pin.aba", "ddm", aba, most=MOST), Method("pin.rnea", "idm", rnea, most=MOST))
