"""RK4 on the spanning tree with one of Pinocchio's solvers, as one writes it: closures drift, unless held.

`hold` says how: "nothing"; "baumgarte", Pinocchio's own correction terms; "projection", Newton steps back to
the closures after every step, and the velocity projected.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin

from hybridyn import HybridRobot
from hybridyn.spatial import Array
from hybridyn.studies.compare.engines.pinocchio_robot import PinocchioEngine
from hybridyn.studies.compare.engines.pinocchio_solvers import ACCURACY, closed, loop_solver
from hybridyn.studies.compare.peer_engine import NotComparableError

#: Of the largest rate that the step allows, critically damped.
BAUMGARTE = 0.1
#: [m].
CLOSED = 1e-12
MOST_STEPS = 5
HOLDS = ("nothing", "baumgarte", "projection")

Acceleration = Callable[[Array, Array], Array]


#: mu and iterations of Pinocchio's solvers: the fastest setting that is good to 1e-10 on the robots flown.
SOLVERS = {"constraintDynamics": (1e-14, 1), "lcaba": (1e-3, 4)}


def prepare(
    robot: HybridRobot, q: Array, v: Array, tau: Array, duration: float, step: float, name: str, hold: str
) -> Callable[[], tuple[Array, Array, int]]:
    """Prepare a run, which gives q and v after every step, (steps + 1, nq), (steps + 1, nv), and the steps.

    Raises:
        NotComparableError: Joints are not all hinges and slides, or Pinocchio cannot state the closures.
    """
    if set(robot.kinds) - {"revolute", "prismatic"}:
        raise NotComparableError("RK4 is written here for hinges and slides")
    own = closed(robot)
    if hold == "baumgarte":
        rate = BAUMGARTE / step
        for constraint in own.contacts:
            constraint.setBaumgarteCorrectorParameters(pin.BaumgarteCorrectorParameters(rate**2, 2 * rate))
    settings = pin.ProximalSettings(ACCURACY, *SOLVERS[name])
    call, effort = loop_solver(own, name), own.efforts(tau)

    def acceleration(q: Array, v: Array) -> Array:
        return call(own.model, own.data, q, v, effort, own.contacts, own.datas, settings).copy()

    judge = closed(robot)  # constraint data of its own: they keep state
    steps = round(duration / step)

    def fly() -> tuple[Array, Array, int]:
        qs, vs = np.zeros((steps + 1, len(q))), np.zeros((steps + 1, len(v)))
        qs[0], vs[0] = q, v
        for i in range(steps):
            qs[i + 1], vs[i + 1] = advance(acceleration, qs[i], vs[i], step)
            if hold == "projection":
                qs[i + 1], vs[i + 1] = projected(judge, qs[i + 1], vs[i + 1])
        return qs, vs, steps

    return fly


def advance(acceleration: Acceleration, q: Array, v: Array, h: float) -> tuple[Array, Array]:
    """Take one step of the classical method."""
    a1 = acceleration(q, v)
    v2 = v + h / 2 * a1
    a2 = acceleration(q + h / 2 * v, v2)
    v3 = v + h / 2 * a2
    a3 = acceleration(q + h / 2 * v2, v3)
    v4 = v + h * a3
    a4 = acceleration(q + h * v3, v4)
    return q + h / 6 * (v + 2 * v2 + 2 * v3 + v4), v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)


def projected(own: PinocchioEngine, q: Array, v: Array) -> tuple[Array, Array]:
    """Return the closed state near one, by steps of least norm."""
    for _ in range(MOST_STEPS):
        K = own.rows(q)
        missing = np.concatenate([data.c1Mc2.translation for data in own.datas])
        if np.abs(missing).max() < CLOSED:
            break
        q = q + np.linalg.lstsq(K, missing, rcond=1e-10)[0]  # Pinocchio's rows have the sign turned
    return q, v - np.linalg.lstsq(K, K @ v, rcond=1e-10)[0]
