"""Forces on all independent coordinates of a floating robot, by models of the robot on a prescribed base.

motor efforts = idm of the held robot, at the same q, v, a
base wrench   = sum over bodies of X^T (I a + v x* I v - I g), from one row of kinematics
D = J_m U + (J Phi) S^-1 (J Phi)^T      U: held robot under J_m^T e_j; Phi: its motions over the base's
                                        accelerations; S: the wrenches that these need
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from functools import partial

import numpy as np

from ....dynamics.direct import ddm
from ....dynamics.inverse import idm
from ....effects.choice import Effects
from ....errors import CompileError
from ....linkage.elimination import back_substitute, pivot_ratio, pivoted_qr
from ....spatial import Array, Index
from ....structure.building import rebuilt
from ....structure.robot import HybridRobot
from ...code.scalars import GUARD_LIMIT, Scalar
from ...failures import as_compile_error
from ...library.cache import Built
from ...library.calls import Library, Numbers, loaded
from ...library.compilers import best_lanes
from ..body_rows import WIDTH
from ..sources import library_of
from .following import FOLLOWING_AGREES, SAMPLES, Following
from .rows import FASTER, Computed, Run, inertial_bodies, link_rows

log = logging.getLogger("hybridyn.compiled")

MODELS = ("idm", "ddm")
#: Reciprocal condition number of the base's articulated inertia, in scaled coordinates, below which the
#: general path computes the sample.
LIGHT_BASE = 1e-8


class HeldBase:
    """Models of a floating robot whose base is held.

    Attributes:
        columns: Entries of v on which forces act: the base's, then the motors'.
    """

    def __init__(self, robot: HybridRobot, on: Effects, dtype: str, run: Run, threads: int) -> None:
        """Load the library from the cache, or build it and compare it with the general path.

        Args:
            on: Effects in its models, velocity terms among them.
            dtype: Type of the arithmetic.
            run: Computes "kinematics" of the robot.
            threads: Number of threads that share a batch.

        Raises:
            CompileError: It cannot be built, or differs from the general path.
        """
        held = rebuilt(robot, base="moving")
        find = library_of(held, on, Scalar(dtype, best_lanes(dtype)), models=MODELS)
        self._library = loaded(lambda: find(accept=partial(_accept, held, on, dtype)))
        self._robot, self._on, self._run, self._threads = robot, on, run, threads
        self.columns: Index = np.concatenate([np.arange(6), robot.motor_v])

    def forces(self, q: Array, v: Array, a: Array) -> Computed:
        """Compute the base's wrench and the motor efforts of a motion, shape (T, 6 + motors)."""
        tau, trusted = self._held("idm", q, v, a)
        wrench, known = self._wrench(q, v, a, self._weight)
        return np.concatenate([wrench, tau], axis=1), trusted & known

    def delassus(self, moves: Following, q: Array, links: Sequence[str], axes: str) -> Computed:
        """Compute J M^-1 J^T of k links, shape (T, 6 k, 6 k); arguments as for `rows.delassus_rows`."""
        J, good = link_rows(self._run, moves, q, links, axes)
        T, rows = J.shape[:2]
        motors, lanes = J.shape[2] - 6, rows + 7  # wrenches on links, accelerations of the base, rest
        tau, base = np.zeros((T, lanes, motors)), np.zeros((T, lanes, 6))
        tau[:, :rows], base[:, rows:-1] = J[:, :, 6:] * 2.0**FASTER, np.eye(6) * 2.0**FASTER
        many = np.repeat(q, lanes, axis=0)
        still = np.zeros((len(many), self._robot.nv))
        a, trusted = self._held("ddm", many, still, tau.reshape(-1, motors), base.reshape(-1, 6))
        a = a.reshape(T, lanes, -1)
        pushed, moved = a[:, :rows] - a[:, -1:], a[:, rows:-1] - a[:, -1:]
        S, known = self._wrench(
            np.repeat(q, 6, axis=0), still[: 6 * T], moved.reshape(6 * T, -1), np.zeros(3)
        )
        S, across = S.reshape(T, 6, 6) * 2.0**-FASTER, moved[:, :, self.columns] @ np.swapaxes(J, 1, 2)
        freed, whole = _through_base(self._robot, S, across * 2.0**-FASTER)
        D = pushed[:, :, self.columns[6:]] * 2.0**-FASTER @ np.swapaxes(J[:, :, 6:], 1, 2) + freed
        good = good & trusted.reshape(T, lanes).all(axis=1) & known.reshape(T, 6).all(axis=1) & whole
        return (D + np.swapaxes(D, 1, 2)) / 2, good

    @property
    def _weight(self) -> Array:
        """Gravity, zero where it is off, shape (3,)."""
        return self._robot.gravity if self._on.gravity is not None else np.zeros(3)

    def _held(self, name: str, *given: Array) -> Computed:
        """Compute a model of the held robot, and which samples can be trusted."""
        calls = self._library.programs[name]
        outputs, guard = calls.batch(given, self._threads)
        return outputs[0], np.asarray(guard <= calls.trusted)

    def _wrench(self, q: Array, v: Array, a: Array, weight: Array) -> Computed:
        """Compute the wrench that moves all bodies as prescribed, about the base's origin, in its axes."""
        rows, known = self._run("kinematics", q, v, a)
        every = rows.reshape(len(q), -1, WIDTH)
        numbers, mass, com, inertia = inertial_bodies(self._robot, self._on)
        x = every[:, numbers]
        R, w, alpha = x[:, :, :9].reshape(*x.shape[:2], 3, 3), x[:, :, 15:18], x[:, :, 21:]
        arm = np.matmul(R, com[:, :, None])[..., 0]
        F = mass[:, None] * (x[:, :, 18:21] + np.cross(alpha, arm) + np.cross(w, np.cross(w, arm)) - weight)
        own, turned = (np.matmul(np.swapaxes(R, 2, 3), y[..., None]) for y in (w, alpha))
        spin = np.matmul(R, np.matmul(inertia, turned))[..., 0]
        spin = spin + np.cross(w, np.matmul(R, np.matmul(inertia, own))[..., 0])
        N = spin + np.cross(x[:, :, 9:12] + arm - every[:, :1, 9:12], F)
        axes = every[:, 0, :9].reshape(-1, 3, 3)
        parts = [np.matmul(y.sum(axis=1)[:, None], axes)[:, 0] for y in (F, N)]
        return np.concatenate(parts, axis=1), known


def held_base(robot: HybridRobot, on: Effects, dtype: str, run: Run, threads: int) -> HeldBase | None:
    """Return the models of a floating robot with its base held, or None if the general path computes forces.

    It alone computes models without velocity terms.
    """
    if on.velocity is None:
        return None
    try:
        with as_compile_error(robot):
            return HeldBase(robot, on, dtype, run, threads)
    except CompileError as error:
        log.warning("quantities: the general path computes them (%s)", error)
        return None


def _through_base(robot: HybridRobot, S: Numbers, across: Numbers) -> Computed:
    """Compute across^T S^-1 across, shape (T, k, k), by QR in scaled coordinates, and where S is regular."""
    unit = np.array([robot.bodies.size] * 3 + [1.0] * 3)
    S, right = (S + np.swapaxes(S, 1, 2)) / 2 * unit[:, None] * unit, across * unit[:, None]
    R, order = pivoted_qr(np.concatenate([S, right], axis=2), 6, 6)
    whole = np.asarray(pivot_ratio(R, 6) >= LIGHT_BASE)
    R[~whole, :6, :6] = np.eye(6)  # the general path computes these
    solved = np.empty_like(right)
    np.put_along_axis(solved, order[:, :, None], back_substitute(R[:, :, :6], R[:, :, 6:]), axis=1)
    return np.matmul(np.swapaxes(right, 1, 2), solved), whole


def _accept(held: HybridRobot, on: Effects, dtype: str, built: Built) -> None:
    """Compare a new library with the general path at random states."""
    from ...equations.states import moving_states

    q, v, tau = moving_states(held, SAMPLES)
    base = v[:, :6]  # any numbers
    a = ddm(held, q, v, tau, base_acceleration=base, effects=on)
    cases = ("ddm", (q, v, tau, base), a), ("idm", (q, v, a), idm(held, q, v, a, effects=on))
    library = Library(built)
    for name, given, wanted in cases:
        (found,), guard = library.batch(name, *given)
        good = guard <= GUARD_LIMIT
        off = np.abs(found - wanted)[good].max(initial=0.0) / (1e-300 + np.abs(wanted).max(initial=0.0))
        if not off <= FOLLOWING_AGREES[dtype]:
            raise CompileError(
                f"the compiled {name} of the robot '{held.description.name}' on a held base differs from the "
                f"general path by {off:.2g} of its largest entry (limit {FOLLOWING_AGREES[dtype]:g}): it is "
                "not used. This is a bug: report it with the robot's files; the general path is right"
            )
