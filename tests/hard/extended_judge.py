"""Backward and forward errors of both models at one state, against the oracle's equations in fifty digits.

The equations of a robot in its spanning tree, K with its dependent rows combined away, are

    M a + h = S^T tau + K^T lambda,      K a + k = 0.

They are taken at the very float64 numbers that the core was given: nothing is refined, so that no part of the
error is the rounding of the input. `Judge` scales coordinates and rows to be without units (the oracle's).

**Backward error** of a result: the least relative change of M, h, S^T tau, K and k that makes it exact. With
the best lambda what is left of the first equation is its part along Z = null(K), orthonormal:

    |Z^T (M a + h - S^T tau)| / (|M||a| + |h| + |tau| + |K||lambda|),   |K a + k| / (|K||a| + |v|^2)

(Rigal and Gaches, 1967; Higham, Accuracy and Stability, theorem 7.1). idm answers for the first alone.

**Condition**: what a change of that size can do to tau, or to a, at most, to first order, relative to it.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import mpmath
import numpy as np

from hybridyn.description import Description
from tests.hard.claims import EPS
from tests.oracle import Extended, Oracle

RANK = 1e-30  # geometry in doubles is dependent to 1e-16 or to all fifty digits, nothing in between
mp = mpmath.mp.clone()
mp.dps = 50


def norm(x: Any) -> float:
    """Return the Euclidean norm of numbers of any arithmetic."""
    return float(np.linalg.norm(np.asarray(x, dtype=float)))


@dataclass(frozen=True)
class Errors:
    """What a result costs.

    Attributes:
        backward: Backward error.
        forward: Relative difference from the reference.
        condition: Condition number of what is solved.
    """

    backward: float
    forward: float
    condition: float

    @property
    def units(self) -> float:
        """The forward error in units of eps times the condition number."""
        return self.forward / (EPS * self.condition)


class Judge:
    """The equations of one robot at one posture and velocity, in fifty digits.

    Args:
        description: The robot: fixed base, as many motors as freedoms.
        q: Posture, shape (nq,), float64.
        v: Rates, shape (nv,), float64; drawn from the posture's motions where left out.
        seed: Of that draw.
        speed: Its root mean square in scaled coordinates.
        speed: Its size in scaled coordinates, per freedom.
    """

    def __init__(
        self,
        description: Description,
        q: np.ndarray,
        v: np.ndarray | None = None,
        *,
        seed: int = 0,
        speed: float = 1.0,
    ) -> None:
        self.oracle = Oracle(description, arithmetic=Extended(mp), rank_tolerance=RANK)
        array = self.oracle.arithmetic.array
        self.q, self.posture = q, self.oracle.posture(q)
        self.unit, self.motors = self.oracle.unit, self.oracle.motors
        self.Z = self.posture.Z
        if v is None:
            rng = np.random.default_rng(seed)
            draw = self.Z.astype(float) @ rng.normal(size=self.Z.shape[1])
            v = self.unit.astype(float) * draw * (speed * np.sqrt(len(draw)) / np.linalg.norm(draw))
        self.v = v
        V, g, k = self.oracle.tree.drifts(self.posture, array(v))
        self._V, self._g = V, g
        U, p = self.posture.factor.U, self.posture
        self._K = U.T @ (p.K * self.unit / p.scale[:, None])  # dependent rows combined away
        self._k = U.T @ (k / p.scale)
        self.h = self.force(array(np.zeros(self.oracle.nv)))

    def force(self, a: Any) -> Any:
        """Return M a + h, scaled, shape (nv,)."""
        posture, a = self.posture, self.oracle.arithmetic.array(a)
        W = self.oracle.bodies.needed(posture, self._V, (posture.G @ a).reshape(-1, 6) + self._g, {})
        return self.unit * (posture.G.T @ W.reshape(-1))

    @cached_property
    def K(self) -> np.ndarray:
        """Scaled independent rows, shape (rank, nv), as doubles."""
        out: np.ndarray = self._K.astype(float)
        return out

    @cached_property
    def K_inverse(self) -> np.ndarray:
        """Pseudo-inverse of K, shape (nv, rank), as doubles, right however close K is to singular."""
        factor = self.posture.factor
        out: np.ndarray = (factor.V @ factor.inverse).astype(float)
        return out

    @property
    def condition_of_rows(self) -> float:
        """Condition number of the scaled rows: the reciprocal of the distance to a constraint singularity."""
        lost = self.Z.shape[1] > len(self.motors)
        return np.inf if lost else norm2(self.K_inverse) * norm2(self.K)

    @cached_property
    def C(self) -> np.ndarray:
        """C with C^T C = M, scaled, as doubles."""
        out: np.ndarray = self.oracle.bodies.inertia_root(self.posture, np.diag(self.unit)).astype(float)
        return out

    @cached_property
    def B(self) -> np.ndarray:
        """The motors' map along Z, scaled, shape (mobility, motors), as doubles."""
        out: np.ndarray = self.Z[self.motors].T.astype(float)
        return out

    # ------------------------------------------------------------------ the reference

    def accelerations(self, tau: np.ndarray) -> Any:
        """Return the exact answer of the direct model, shape (nv,)."""
        given = self.oracle.posture
        self.oracle.posture = lambda q: self.posture  # type: ignore[method-assign]
        try:
            return self.oracle.ddm(self.q, self.v, tau)
        finally:
            self.oracle.posture = given  # type: ignore[method-assign]

    def efforts(self, a: np.ndarray) -> Any:
        """Return the exact answer of the inverse model, shape (motors,): B is square and regular."""
        needed = self.Z.T @ self.force(a)
        scaled = self.oracle.arithmetic.solve(self.Z[self.motors].T, needed[:, None])[:, 0]
        return scaled / self.unit[self.motors]

    # ------------------------------------------------------------------ the verdicts

    def of_idm(self, a: np.ndarray, tau: np.ndarray, exact: Any = None, dropped: int = 0) -> Errors:
        """Judge the inverse model's efforts for accelerations a.

        Args:
            a: The accelerations, shape (nv,).
            tau: What the core gave, shape (motors,).
            exact: The right answer; that of a regular map of the motors where left out.
            dropped: Number of directions of the motors that a least-norm answer leaves out.
        """
        array = self.oracle.arithmetic.array
        effort = self._effort(tau)
        F = self.force(a)
        left = self.Z.T @ (F - effort)
        total = self._terms(a, F, effort)
        unit = self.unit[self.motors].astype(float)
        exact = self.efforts(a) if exact is None else exact
        wrong = norm((array(tau) - exact) * unit)
        size = norm(exact * unit)
        share = np.linalg.svd(self.B, compute_uv=False)[-1 - dropped]
        return Errors(norm(left) / total, wrong / size, total / (share * size))

    def of_ddm(self, tau: np.ndarray, a: np.ndarray, exact: Any = None) -> Errors:
        """Judge the direct model's accelerations under efforts tau."""
        array = self.oracle.arithmetic.array
        effort = self._effort(tau)
        F = self.force(a)
        scaled = array(a) / self.unit
        apart = norm(self._K @ scaled + self._k)
        apart_terms = norm2(self.K) * norm(scaled) + norm(self.v / self.unit) ** 2
        left = norm(self.Z.T @ (F - effort))
        terms = self._terms(a, F, effort)
        exact = self.accelerations(tau) if exact is None else exact
        size = norm(exact / self.unit)
        # a = -K^+ k + Z (Z^T M Z)^-1 Z^T (S^T tau - h + M K^+ k)
        Z = self.Z.astype(float)
        P = np.linalg.pinv(self.C @ Z, rcond=1e-14)
        bound = self.K_inverse - Z @ (P @ (self.C @ self.K_inverse))
        free = norm2(P) ** 2
        condition = (free * terms + norm2(bound) * apart_terms) / size
        return Errors(
            max(left / terms, apart / apart_terms), norm((array(a) - exact) / self.unit) / size, condition
        )

    def _effort(self, tau: np.ndarray) -> Any:
        """Return S^T tau, scaled, shape (nv,)."""
        out = self.unit * 0
        for motor, value in zip(self.motors, self.oracle.arithmetic.array(tau), strict=True):
            out[motor] = self.unit[motor] * value
        return out

    def _terms(self, a: np.ndarray, F: Any, effort: Any) -> float:
        """Return |M||a| + |h| + |tau| + |K||lambda|."""
        lam = norm(self.K_inverse.T @ (F - effort).astype(float))
        return norm2(self.C) ** 2 * norm(a / self.unit) + norm(self.h) + norm(effort) + norm2(self.K) * lam


def norm2(A: np.ndarray) -> float:
    """Return the largest singular value."""
    return float(np.linalg.norm(A, 2)) if A.size else 0.0
