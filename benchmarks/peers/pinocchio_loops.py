"""A robot in Pinocchio's words: its spanning tree, its closures at points and welds, its solvers for them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin

from benchmarks.methods import Method, NotMeasuredError, Setting, Solver, grid
from hybridyn import HybridRobot
from hybridyn.spatial import Array, Index
from hybridyn.structure.building import rebuilt
from hybridyn.studies.compare.engines import pinocchio_engine
from hybridyn.studies.compare.own_file import OwnFile

#: Of the proximal iterations: they end at their count, or when nothing changes any more.
ACCURACY = 1e-15
#: What is swept of the two solvers for closed loops, both proximal: the sparse Cholesky factors of the KKT
#: matrix, and the loop-constrained articulated body algorithm, of linear cost.
SWEPT = {
    "constraintDynamics": grid(mu=(1e-14, 1e-12, 1e-10, 1e-8, 1e-6, 1e-4, 1e-2), iterations=(1, 2, 3, 5, 10)),
    "lcaba": grid(mu=(1e-8, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1), iterations=(1, 2, 3, 4, 5, 6, 8, 10, 15)),
}
#: Velocities: Pinocchio's Data holds several nv^3 tensors, 3 GB there.
MOST = 400


@dataclass(frozen=True)
class Loops:
    """What Pinocchio needs to close a robot's loops. Make one for each algorithm: they keep state in it.

    Attributes:
        model, data: Pinocchio's.
        constraints, constraint_data: The closures.
        motors: Index in v of each motor.
        passive: Index in v of everything else.
    """

    model: pin.Model
    data: Any
    constraints: Any
    constraint_data: Any
    motors: Index
    passive: Index

    def efforts(self, tau: Array) -> Array:
        """Spread the motors' efforts over the tree, shape (nv,)."""
        out = np.zeros(self.model.nv)
        out[self.motors] = tau
        return out


def loops(robot: HybridRobot) -> Loops:
    """Write a robot for Pinocchio, as `hybridyn compare` does.

    Raises:
        NotMeasuredError: It has closures that Pinocchio cannot state.
    """
    *_, (_, build) = pinocchio_engine.ways(at_points(robot), OwnFile())
    own: Any = build()
    passive = np.setdiff1d(np.arange(robot.nv), robot.motor_v)
    return Loops(own.model, own.data, own.contacts, own.datas, robot.motor_v, passive)


def tree(robot: HybridRobot) -> pin.Model:
    """Return a copy of the spanning tree's model.

    Raises:
        NotMeasuredError: Couplings hold it.
    """
    if robot.description.couplings:
        raise NotMeasuredError("couplings of joints are no closures for Pinocchio")
    return robot.model.copy()


def at_points(robot: HybridRobot) -> HybridRobot:
    """Return a robot whose loops are closed at points and welds; a plane keeps a hinge's axes parallel.

    Raises:
        NotMeasuredError: They cannot be, or couplings hold it.
    """
    tree(robot)
    closures = []
    for closure in robot.description.closures:
        kinds = ("free", "fixed", *(["parallel"] if planar(robot) else []))
        if closure.translations != (0, 1, 2) or closure.rotation not in kinds:
            raise NotMeasuredError(f"closure '{closure.name}' ({closure.kind}) is neither a point nor a weld")
        point = replace(closure, kind="spherical", rotation="free")
        closures.append(point if closure.rotation == "parallel" else closure)
    if tuple(closures) == robot.description.closures:
        return robot
    return rebuilt(robot, replace(robot.description, closures=tuple(closures)))


def planar(robot: HybridRobot) -> bool:
    """Tell whether every joint is a hinge and all axes at home are parallel."""
    if set(robot.kinds) - {"revolute", "continuous"}:
        return False
    model = robot.model
    data = model.createData()
    pin.computeJointJacobians(model, data, robot.home)
    axes = data.J[3:].T
    return bool(np.abs(np.cross(axes, axes[0])).max() < 1e-12)


def solver(own: Loops, name: str) -> Callable[..., Array]:
    """Prepare one of Pinocchio's solvers; `lcaba` without the minimal ordering would end the process."""
    if name == "lcaba":
        pin.computeJointMinimalOrdering(own.model, own.data, own.constraints)
    solve: Callable[..., Array] = getattr(pin, name)
    return solve


def setup(name: str, robot: HybridRobot) -> Callable[[Setting], Solver]:
    """Prepare a robot for one of them."""
    own = loops(robot)
    call, closures = solver(own, name), (own.constraints, own.constraint_data)

    def at(setting: Setting) -> Solver:
        settings = pin.ProximalSettings(ACCURACY, setting["mu"], int(setting["iterations"]))

        def solve(q: Array, v: Array, tau: Array) -> Array:
            return call(own.model, own.data, q, v, own.efforts(tau), *closures, settings)

        return solve

    return at


METHODS = tuple(
    Method(f"pin.{name}", "ddm", partial(setup, name), settings, most=MOST)
    for name, settings in SWEPT.items()
)
