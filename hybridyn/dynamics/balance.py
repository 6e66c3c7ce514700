"""Equation of motion of one module, A_t u_dot = Q_0 - E V_dot_base, summed over its legs and outputs.

The size of the terms is stored with each sum, because the rounding of a sum is proportional to its terms.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..linkage.reduction import Basis
from ..spatial import Array
from ..structure.state import ModuleState
from .inertia_solve import InertiaFactor
from .loads import Loads


@dataclass(frozen=True, eq=False)
class LegTerms:
    """Inertia and forces of a module's legs, including rotors and the loads on the legs.

    Attributes:
        M: Inertia for [V_dot_base; x_ddot], shape (T, 6 + n, 6 + n), with blocks A and D, Eqs. (63)-(75).
        p: Wrench of the base on the legs at zero accelerations, minus the wrench of the loads on the base,
            shape (T, 6), Eqs. (71)-(73).
        h: Generalised force along x at zero accelerations, shape (T, n).
        f: Generalised force of the loads along x, shape (T, n).
    """

    M: Array
    p: Array
    h: Array
    f: Array


def leg_terms(state: ModuleState, loads: Loads, k: int) -> LegTerms:
    """Compute the inertia and forces of the legs of module k."""
    M = loads.on.leg_matrix(state)
    if (rotor := loads.rotor_diagonal(state)) is not None:
        M[:, 6:, 6:] += np.diag(rotor)
    p, h = loads.on.leg_bias(state)
    f_base, f = loads.on_legs(k, state)
    return LegTerms(M, p - f_base, h, f)


@dataclass(eq=False)
class Balance:
    """Equation of motion A_t u_dot = Q_0 - E V_dot_base, Eq. (40), summed over legs and outputs.

    Attributes:
        A_t, E, Q_0: Shapes (T, N, N), (T, N, 6), (T, N).
        noise: Sum of the absolute values of the terms in A_t, shape (T, N, N).
        carried: Upper bound, as an inertia, on the rounding that the outputs pass on, shape (T, N, N).
        size: Largest term in Q_0, shape (T,).
    """

    A_t: Array
    E: Array
    Q_0: Array
    noise: Array
    carried: Array
    size: Array

    def add_output(self, a_map: Array, X: Array, I_star: Array, b: Array, rounding: Array) -> None:
        """Add an output with acceleration a_map u_dot + X V_dot_base + c.

        Args:
            a_map: Shape (T, 6, N).
            X: Motion matrix from the base, shape (T, 6, 6).
            I_star: Articulated inertia of the output, shape (T, 6, 6).
            b: Wrench that the output needs at u_dot = 0 and V_dot_base = 0, shape (T, 6).
            rounding: Upper bound on the rounding of I_star, as an inertia, shape (T, 6, 6).
        """
        self.A_t += congruence(a_map, I_star)  # Eq. (43)
        self.noise += congruence(np.abs(a_map), np.abs(I_star))
        self.carried += congruence(a_map, rounding)
        self.E += np.einsum("tij,tik,tkl->tjl", a_map, I_star, X, optimize=True)  # Eq. (42)
        self.Q_0 -= np.einsum("tij,ti->tj", a_map, b)  # Eq. (44)
        self.size = np.maximum(self.size, _size(a_map, np.abs(b)))


def balance_of_legs(s: ModuleState, legs: LegTerms, basis: Basis, tau: Array) -> Balance:
    """Compute the terms of a module's legs and motors in its equation of motion."""
    Psi, A, D = basis.Psi, legs.M[:, 6:, 6:], legs.M[:, 6:, :6]
    A_t = congruence(Psi, A)
    needed = legs.f - legs.h - np.einsum("tij,tj->ti", A, basis.drift)
    needed[:, s.module.motor_columns] += tau
    return Balance(
        A_t=A_t,
        E=np.einsum("tij,tik->tjk", Psi, D),
        Q_0=np.einsum("tij,ti->tj", Psi, needed),
        noise=congruence(np.abs(Psi), np.abs(A)),
        carried=np.zeros_like(A_t),
        size=_size(Psi, np.abs(needed) + np.abs(legs.h) + np.abs(legs.f)),
    )


def size_of_solution(x: Balance, inertia: InertiaFactor, y: Array) -> Array:
    """Compute the largest term in the sum y = A_t^-1 Q_0, shape (T,)."""
    resisted = np.square(inertia.R[:, :1, :1].max(axis=(1, 2), initial=0.0))
    kept = largest(x.Q_0)
    terms = largest(y) * np.maximum(x.size / np.where(kept > 0, kept, np.inf), 1.0)
    return np.maximum(terms, x.size / np.where(resisted > 0, resisted, np.inf))


def congruence(B: Array, M: Array) -> Array:
    """Compute B^T M B for B of shape (T, n, N) and M of shape (T, n, n)."""
    out: Array = np.matmul(np.swapaxes(B, 1, 2), np.matmul(M, B))
    return out


def largest(x: Array) -> Array:
    """Compute the largest absolute entry of each sample, shape (T,)."""
    out: Array = np.abs(x).max(axis=1, initial=0.0)
    return out


def _size(B: Array, force: Array) -> Array:
    """Compute the largest entry of abs(B)^T abs(force), shape (T,)."""
    out: Array = np.einsum("tij,ti->tj", np.abs(B), np.abs(force)).max(axis=1, initial=0.0)
    return out
