"""The algorithms of Pinocchio: solvers for closed loops, `aba` and `rnea` of trees, `rnea` projected.

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

import numpy as np
import pinocchio as pin

from ....spatial import Array, Index
from ....structure.robot import HybridRobot
from ..methods import Model, Setting, Solver
from ..peer_engine import NotComparableError, at_points
from .pinocchio_robot import PinocchioEngine, with_constraints

#: Of the proximal iterations: they end at their count, or when nothing changes any more.
ACCURACY = 1e-15

Parts = list[tuple[Index, Index, Index]]  # rows, motors and passive freedoms of each module


def closed(robot: HybridRobot) -> PinocchioEngine:
    """Return a robot with all its closures. Make one for each algorithm: they keep state in it.

    Raises:
        NotComparableError: It has closures or couplings that Pinocchio cannot state.
    """
    own = with_constraints(at_points(robot))
    if own.notes:
        raise NotComparableError(own.notes[0])
    return own


def loop_solver(own: PinocchioEngine, name: str) -> Callable[..., Array]:
    """Prepare one of the solvers for loops; `lcaba` without the minimal ordering would end the process."""
    if name == "lcaba":
        pin.computeJointMinimalOrdering(own.model, own.data, own.contacts)
    solve: Callable[..., Array] = getattr(pin, name)
    return solve


def direct(name: str, robot: HybridRobot) -> Callable[[Setting], Solver]:
    """Prepare a robot for one of them."""
    own = closed(robot)
    call, closures = loop_solver(own, name), (own.contacts, own.datas)

    def at(setting: Setting) -> Solver:
        settings = pin.ProximalSettings(ACCURACY, setting["mu"], int(setting["iterations"]))

        def solve(q: Array, v: Array, tau: Array) -> Array:
            return call(own.model, own.data, q, v, own.efforts(tau), *closures, settings)

        return solve

    return at


def project(K: Array, Q: Array, motors: Index, passive: Index) -> Array:
    """Return the motors' efforts (..., motors) that do the work of Q (..., nv)."""
    K_p = np.swapaxes(K[..., passive], -1, -2)
    if K_p.shape[-1] == K_p.shape[-2]:
        forces = np.linalg.solve(K_p, Q[..., passive, None])
    else:
        forces = np.linalg.pinv(K_p, rcond=1e-10) @ Q[..., passive, None]
    out: Array = Q[..., motors] - (np.swapaxes(K[..., motors], -1, -2) @ forces)[..., 0]
    return out


def projected(robot: HybridRobot) -> PinocchioEngine:
    """Return a robot whose motors determine every motion, for the projection.

    Raises:
        NotComparableError: It has no closures, or passive motions that the motors do not determine.
    """
    if not robot.description.closures:
        raise NotComparableError("no loops: pin.rnea alone does it")
    if robot.mobility != len(robot.motors):
        raise NotComparableError(
            f"{robot.mobility} freedoms, {len(robot.motors)} motors: no projection onto them"
        )
    return closed(robot)


def dense(robot: HybridRobot) -> Callable[[Setting], Solver]:
    """Project with one solve for the whole robot."""
    own, motors = projected(robot), robot.motor_v
    passive = np.setdiff1d(np.arange(robot.nv), motors)

    def solve(q: Array, v: Array, a: Array) -> Array:
        K = own.rows(q)
        return project(K, pin.rnea(own.model, own.data, q, v, a), motors, passive)

    return lambda setting: solve


def per_module(robot: HybridRobot) -> Callable[[Setting], Solver]:
    """Project module after module; equal modules in one stacked solve."""
    own = projected(robot)
    alike: dict[tuple[int, int, int], Parts] = {}
    for rows, motors, passive in _parts(robot, own):
        alike.setdefault((len(rows), len(motors), len(passive)), []).append((rows, motors, passive))
    groups = [tuple(np.array(x) for x in zip(*same, strict=True)) for same in alike.values()]

    def solve(q: Array, v: Array, a: Array) -> Array:
        K = own.rows(q)
        Q = pin.rnea(own.model, own.data, q, v, a)
        whole = Q.copy()
        for rows, motors, passive in groups:
            freedoms = np.concatenate([motors, passive], axis=1)
            own_K = K[rows[:, :, None], freedoms[:, None, :]]
            m = motors.shape[1]
            split = np.arange(freedoms.shape[1])
            whole[motors] = project(own_K, Q[freedoms], split[:m], split[m:])
        out: Array = whole[robot.motor_v]
        return out

    return lambda setting: solve


def _parts(robot: HybridRobot, own: PinocchioEngine) -> Parts:
    """Return each module's rows of K, motors and passive freedoms; one without loops has no rows."""
    rows: dict[str, list[int]] = {}
    at = 0
    for name, contact in zip(own.owners, own.contacts, strict=True):
        size = 3 if contact.type == pin.ContactType.CONTACT_3D else 6
        rows.setdefault(name, []).extend(range(at, at + size))
        at += size
    out = []
    for module in robot.modules:
        mine = [row for name in module.closures for row in rows[name]]
        motors = np.array([i for i in robot.motor_v if i in module.v_index], dtype=int)
        if mine:
            out.append((np.array(mine, dtype=int), motors, np.setdiff1d(module.v_index, motors)))
    return out


def tree_alone(model: Model, closed: bool, robot: HybridRobot) -> Callable[[Setting], Solver]:
    """Prepare `pin.aba` or `pin.rnea`; of a robot with loops, the tree cut open.

    Raises:
        NotComparableError: It has no loops where some are wanted, or the other way round; or couplings.
    """
    if robot.description.couplings:
        raise NotComparableError("couplings of joints are no closures for Pinocchio")
    if bool(robot.description.closures) != closed:
        raise NotComparableError("no loops: listed as pin.rnea" if closed else "it has loops")
    own, motors = robot.unchanged_model.copy(), robot.motor_v
    data, efforts = own.createData(), np.zeros(robot.nv)

    def direct(q: Array, v: Array, tau: Array) -> Array:
        efforts[motors] = tau
        a: Array = pin.aba(own, data, q, v, efforts)
        return a.copy()

    def inverse(q: Array, v: Array, a: Array) -> Array:
        out: Array = pin.rnea(own, data, q, v, a)[motors]
        return out

    return lambda setting: direct if model == "ddm" else inverse
