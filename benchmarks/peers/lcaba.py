"""`pin.lcaba`: the loop-constrained articulated body algorithm, proximal, of linear cost."""

from __future__ import annotations

from collections.abc import Callable

import pinocchio as pin

from benchmarks.methods import Method, Setting, Solver, grid
from benchmarks.peers.pinocchio_loops import MOST, loops
from hybridyn import HybridRobot
from hybridyn.spatial import Array

ACCURACY = 1e-15
SETTINGS = grid(mu=(1e-8, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1), iterations=(1, 2, 3, 4, 5, 6, 8, 10, 15))


def setup(robot: HybridRobot) -> Callable[[Setting], Solver]:
    """Prepare a robot; without the minimal ordering the process would die."""
    own = loops(robot)
    pin.computeJointMinimalOrdering(own.model, own.data, own.constraints)

    def at(setting: Setting) -> Solver:
        settings = pin.ProximalSettings(ACCURACY, setting["mu"], int(setting["iterations"]))

        def solve(q: Array, v: Array, tau: Array) -> Array:
            a: Array = pin.lcaba(
                own.model, own.data, q, v, own.efforts(tau), own.constraints, own.constraint_data, settings
            )
            return a

        return solve

    return at


METHODS = (Method("pin.lcaba", "ddm", setup, SETTINGS, most=MOST),)
