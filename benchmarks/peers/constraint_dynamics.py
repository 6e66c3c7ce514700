"""`pin.constraintDynamics`: sparse Cholesky of the KKT matrix, proximal iterations."""

from __future__ import annotations

from collections.abc import Callable

import pinocchio as pin

from benchmarks.methods import Method, Setting, Solver, grid
from benchmarks.peers.pinocchio_loops import MOST, loops
from hybridyn import HybridRobot
from hybridyn.spatial import Array

ACCURACY = 1e-15  # of the proximal iterations: they end at their count, or when nothing changes any more
SETTINGS = grid(mu=(1e-14, 1e-12, 1e-10, 1e-8, 1e-6, 1e-4, 1e-2), iterations=(1, 2, 3, 5, 10))


def setup(robot: HybridRobot) -> Callable[[Setting], Solver]:
    """Prepare a robot."""
    own = loops(robot)
    pin.initConstraintDynamics(own.model, own.data, own.constraints, own.constraint_data)

    def at(setting: Setting) -> Solver:
        settings = pin.ProximalSettings(ACCURACY, setting["mu"], int(setting["iterations"]))

        def solve(q: Array, v: Array, tau: Array) -> Array:
            a: Array = pin.constraintDynamics(
                own.model, own.data, q, v, own.efforts(tau), own.constraints, own.constraint_data, settings
            )
            return a

        return solve

    return at


METHODS = (Method("pin.constraintDynamics", "ddm", setup, SETTINGS, most=MOST),)
