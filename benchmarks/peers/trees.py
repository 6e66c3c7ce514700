"""Pinocchio's algorithms for trees: `aba`, `rnea`, and `rnea` projected through the closures.

The projection is the honest baseline of inverse dynamics. With K the closure rows, split into motors m and
passive joints p, K v = 0 and Q the tree's efforts,

    tau = Q_m - K_m^T K_p^-T Q_p,

one solve of K_p: of all the robot at once (dense), or module after module, since a module's rows touch its
own joints only. Where K_p is not square, the minimum-norm solution of the same rows. A cheaper baseline of
equal accuracy is not known to us. `pin.rnea` of a robot with loops, which does not close them, is listed too:
its time is a floor for whoever starts there, its efforts are another robot's.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import pinocchio as pin

from benchmarks.methods import Method, Model, NotMeasuredError, Setting, Solver
from benchmarks.peers.pinocchio_loops import MOST, Loops, loops, tree
from hybridyn import HybridRobot
from hybridyn.spatial import Array, Index

Parts = list[tuple[Index, Index, Index]]  # rows, motors and passive freedoms of each module


def closure_rows(own: Loops, q: Array) -> Array:
    """Return K, shape (rows, nv)."""
    pin.computeJointJacobians(own.model, own.data, q)
    for constraint, data in zip(own.constraints, own.constraint_data, strict=True):
        constraint.calc(own.model, own.data, data)
    K: Array = pin.getConstraintsJacobian(own.model, own.data, own.constraints, own.constraint_data)
    return K


def project(K: Array, Q: Array, motors: Index, passive: Index) -> Array:
    """Return the motors' efforts (..., motors) that do the work of Q (..., nv)."""
    K_p = np.swapaxes(K[..., passive], -1, -2)
    if K_p.shape[-1] == K_p.shape[-2]:
        forces = np.linalg.solve(K_p, Q[..., passive, None])
    else:
        forces = np.linalg.pinv(K_p, rcond=1e-10) @ Q[..., passive, None]
    out: Array = Q[..., motors] - (np.swapaxes(K[..., motors], -1, -2) @ forces)[..., 0]
    return out


def prepared(robot: HybridRobot) -> Loops:
    """Prepare a robot with closures.

    Raises:
        NotMeasuredError: It has none, or passive motions that the motors do not determine.
    """
    if not robot.description.closures:
        raise NotMeasuredError("no loops: pin.rnea alone does it")
    if robot.mobility != len(robot.motors):
        raise NotMeasuredError(
            f"{robot.mobility} freedoms, {len(robot.motors)} motors: no projection onto them"
        )
    return loops(robot)


def dense(robot: HybridRobot) -> Callable[[Setting], Solver]:
    """Project with one solve for the whole robot."""
    own = prepared(robot)

    def solve(q: Array, v: Array, a: Array) -> Array:
        K = closure_rows(own, q)
        return project(K, pin.rnea(own.model, own.data, q, v, a), own.motors, own.passive)

    return lambda setting: solve


def per_module(robot: HybridRobot) -> Callable[[Setting], Solver]:
    """Project module after module; equal modules in one stacked solve."""
    own = prepared(robot)
    alike: dict[tuple[int, int, int], Parts] = {}
    for rows, motors, passive in _parts(robot, own):
        alike.setdefault((len(rows), len(motors), len(passive)), []).append((rows, motors, passive))
    groups = [tuple(np.array(x) for x in zip(*same, strict=True)) for same in alike.values()]

    def solve(q: Array, v: Array, a: Array) -> Array:
        K = closure_rows(own, q)
        Q = pin.rnea(own.model, own.data, q, v, a)
        whole = Q.copy()
        for rows, motors, passive in groups:
            freedoms = np.concatenate([motors, passive], axis=1)
            own_K = K[rows[:, :, None], freedoms[:, None, :]]
            m = motors.shape[1]
            split = np.arange(freedoms.shape[1])
            whole[motors] = project(own_K, Q[freedoms], split[:m], split[m:])
        out: Array = whole[own.motors]
        return out

    return lambda setting: solve


def _parts(robot: HybridRobot, own: Loops) -> Parts:
    """Return each module's rows of K, motors and passive freedoms; one without loops has no rows."""
    owner = {name: k for k, module in enumerate(robot.modules) for name in module.closures}
    rows: list[list[int]] = [[] for _ in robot.modules]
    at = 0
    for closure, constraint in zip(robot.description.closures, own.constraints, strict=True):
        size = 3 if constraint.type == pin.ContactType.CONTACT_3D else 6
        rows[owner[closure.name]] += range(at, at + size)
        at += size
    out = []
    for k, module in enumerate(robot.modules):
        motors = np.array([i for i in own.motors if i in module.v_index], dtype=int)
        passive = np.setdiff1d(module.v_index, motors)
        if rows[k]:
            out.append((np.array(rows[k], dtype=int), motors, passive))
    return out


def tree_alone(model: Model, closed: bool, robot: HybridRobot) -> Callable[[Setting], Solver]:
    """Prepare `pin.aba` or `pin.rnea`; of a robot with loops, the tree cut open.

    Raises:
        NotMeasuredError: It has no loops where some are wanted, or the other way round.
    """
    if bool(robot.description.closures) != closed:
        raise NotMeasuredError("no loops: listed as pin.rnea" if closed else "it has loops")
    own, motors = tree(robot), robot.motor_v
    data, efforts = own.createData(), np.zeros(robot.nv)

    def direct(q: Array, v: Array, tau: Array) -> Array:
        efforts[motors] = tau
        a: Array = pin.aba(own, data, q, v, efforts)
        return a.copy()

    def inverse(q: Array, v: Array, a: Array) -> Array:
        out: Array = pin.rnea(own, data, q, v, a)[motors]
        return out

    return lambda setting: direct if model == "ddm" else inverse


METHODS = (
    Method("pin.rnea + projection, dense", "idm", dense, most=MOST),
    Method("pin.rnea + projection, per module", "idm", per_module, most=MOST),
    Method("pin.rnea, loops open", "idm", partial(tree_alone, "idm", True), most=MOST),
    Method("pin.aba", "ddm", partial(tree_alone, "ddm", False), most=MOST),
    Method("pin.rnea", "idm", partial(tree_alone, "idm", False), most=MOST),
)
