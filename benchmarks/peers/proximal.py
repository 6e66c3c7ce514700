"""Pinocchio's two solvers for closed loops, both proximal, swept over mu and iterations.

`pin.constraintDynamics`: sparse Cholesky of the KKT matrix. `pin.lcaba`: the loop-constrained articulated
body algorithm, of linear cost.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import pinocchio as pin

from benchmarks.methods import Method, Setting, Solver, grid
from benchmarks.peers.pinocchio_loops import MOST, Loops, loops
from hybridyn import HybridRobot
from hybridyn.spatial import Array

#: Sets a robot up and gives what is called with it, a state and the settings.
Prepare = Callable[[Loops], Callable[..., Array]]

#: Of the proximal iterations: they end at their count, or when nothing changes any more.
ACCURACY = 1e-15
SPARSE = grid(mu=(1e-14, 1e-12, 1e-10, 1e-8, 1e-6, 1e-4, 1e-2), iterations=(1, 2, 3, 5, 10))
ARTICULATED = grid(mu=(1e-8, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1), iterations=(1, 2, 3, 4, 5, 6, 8, 10, 15))


def sparse(own: Loops) -> Callable[..., Array]:
    """Give `pin.constraintDynamics`, for which the data are prepared."""
    solve: Callable[..., Array] = pin.constraintDynamics
    return solve


def articulated(own: Loops) -> Callable[..., Array]:
    """Prepare `pin.lcaba`; without the minimal ordering the process would die."""
    pin.computeJointMinimalOrdering(own.model, own.data, own.constraints)
    solve: Callable[..., Array] = pin.lcaba
    return solve


def setup(
    prepare: Callable[[Loops], Callable[..., Array]], robot: HybridRobot
) -> Callable[[Setting], Solver]:
    """Prepare a robot for one of them."""
    own = loops(robot)
    call = prepare(own)
    fixed: tuple[Any, ...] = (own.constraints, own.constraint_data)

    def at(setting: Setting) -> Solver:
        settings = pin.ProximalSettings(ACCURACY, setting["mu"], int(setting["iterations"]))

        def solve(q: Array, v: Array, tau: Array) -> Array:
            return call(own.model, own.data, q, v, own.efforts(tau), *fixed, settings)

        return solve

    return at


METHODS = (
    Method("pin.constraintDynamics", "ddm", partial(setup, sparse), SPARSE, most=MOST),
    Method("pin.lcaba", "ddm", partial(setup, articulated), ARTICULATED, most=MOST),
)
