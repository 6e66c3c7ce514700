"""Solve A_t x = b with the articulated inertia A_t of a module, symmetric and positive semidefinite.

The Cholesky factorization with diagonal pivoting is accurate for graded matrices (light legs under a heavy
platform). A pivot that does not exceed the rounding of its terms belongs to a motion without inertia. The
bounds on this rounding are computed from what `direct_recursion` keeps of a module.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..linkage.elimination import back_substitute
from ..spatial import Array, Index
from .guards import EPS

if TYPE_CHECKING:
    from .direct_recursion import ArticulatedModule


def congruence(B: Array, M: Array) -> Array:
    """Compute B^T M B for B of shape (T, n, N) and M of shape (T, n, n)."""
    out: Array = np.matmul(np.swapaxes(B, 1, 2), np.matmul(M, B))
    return out


@dataclass(frozen=True, eq=False)
class InertiaFactor:
    """A pivoted Cholesky factor P^T A P = R^T R of many matrices.

    Attributes:
        R: Upper triangular factors, shape (T, N, N); rows of dropped pivots are zero.
        order: Pivot order, shape (T, N).
        massless: Number of dropped pivots (the last ones), shape (T,).
    """

    R: Array
    order: Index
    massless: Index

    def solve(self, b: Array) -> tuple[Array, Array]:
        """Solve A x = b for b of shape (T, N, c), with x = 0 for the dropped pivots.

        Returns:
            x, and the part of b that acts on massless motions, both of shape (T, N, c).
        """
        y = np.take_along_axis(b, self.order[:, :, None], axis=1)
        for i in range(b.shape[1]):
            pivot = self.R[:, i, i]
            kept = pivot > 0
            row = np.where(kept[:, None], y[:, i] / np.where(kept, pivot, 1.0)[:, None], 0.0)
            y[:, i + 1 :] -= self.R[:, i, i + 1 :, None] * row[:, None]
            y[:, i] = np.where(kept[:, None], row, y[:, i])
        dropped = (np.diagonal(self.R, axis1=1, axis2=2) == 0)[:, :, None]
        left, x = np.zeros_like(b), np.empty_like(b)
        np.put_along_axis(left, self.order[:, :, None], np.where(dropped, y, 0.0), axis=1)
        solved = back_substitute(self.R, np.where(dropped, 0.0, y))
        np.put_along_axis(x, self.order[:, :, None], solved, axis=1)
        return x, left

    def null_space(self, sample: int) -> Array:
        """Compute a basis of the massless motions of one sample, shape (N, massless)."""
        N, k = self.R.shape[1], int(self.massless[sample])
        r = N - k
        null = np.zeros((N, k))
        upper = -back_substitute(self.R[sample : sample + 1, :r, :r], self.R[sample : sample + 1, :r, r:])[0]
        null[self.order[sample]] = np.vstack([upper, np.eye(k)])
        return null


def factor_inertia(A: Array, noise: Array) -> InertiaFactor:
    """Factor inertia matrices with diagonal pivoting.

    Args:
        A: Symmetric positive semidefinite matrices, shape (T, N, N), all entries in [kg m^2].
        noise: Rounding of each diagonal entry, shape (T, N); pivots at or below it are dropped.
    """
    T, N, _ = A.shape
    A, noise = A.copy(), noise.copy()
    R = np.zeros_like(A)
    order = np.tile(np.arange(N), (T, 1))
    batch = np.arange(T)
    massless = np.zeros(T, dtype=int)
    for k in range(N):
        diagonal = np.diagonal(A, axis1=1, axis2=2)[:, k:]
        excess = np.where(diagonal > noise[:, k:], diagonal, -1.0)
        best = k + np.argmax(excess, axis=1)
        for x in (order, noise):
            x[batch, k], x[batch, best] = x[batch, best], x[batch, k].copy()
        for x in (A, R):
            x[batch, :, k], x[batch, :, best] = x[batch, :, best], x[batch, :, k].copy()
        A[batch, k], A[batch, best] = A[batch, best], A[batch, k].copy()
        kept = A[:, k, k] > noise[:, k]
        massless += ~kept
        root = np.sqrt(np.where(kept, A[:, k, k], 1.0))
        R[:, k, k:] = np.where(kept[:, None], A[:, k, k:] / root[:, None], 0.0)
        A[:, k + 1 :, k + 1 :] -= R[:, k, k + 1 :, None] * R[:, k, None, k + 1 :]
    return InertiaFactor(R, order, massless)


def seeming(x: ArticulatedModule, noise: Array) -> Array:
    """Compute the inertia that rounding feigns in each motion of a module, shape (T, N).

    Args:
        x: The module's equation of motion.
        noise: Upper bounds on the rounding of I_star, as inertias, shape (T, outputs, 6, 6).
    """
    terms = congruence(np.abs(x.basis.Psi), np.abs(x.legs.M[:, 6:, 6:]))
    carried = np.zeros_like(x.A_t)
    for o, a in enumerate(x.a_maps):
        terms += congruence(np.abs(a), np.abs(x.I_star[:, o]))
        carried += congruence(a, noise[:, o])
    rounding = 4 * x.state.mechanism.tree.nv * EPS * terms + carried
    out: Array = np.diagonal(rounding, axis1=1, axis2=2) + _inertia_of_slips(x)
    return out


def seeming_at_base(x: ArticulatedModule, noise: Array) -> Array:
    """Compute an upper bound on the rounding that a module hands on to its base, as an inertia, (T, 6, 6).

    A motion in which a body does not take part is a difference of equal terms: an output's has a rounding d,
    and d^T I d remains. The legs' inertia is computed whole, and a part of it remains. Without mass of its
    own, the base would seem to have these inertias.

    Args:
        x: The module's equation of motion.
        noise: As in `seeming`.
    """
    Psi, G, rounding = x.basis.Psi, np.abs(x.G), EPS * (x.basis.Psi.shape[2] + 2)
    with_base = np.concatenate([np.tile(np.eye(6), (len(G), 1, 1)), np.abs(Psi) @ G], axis=1)
    out: Array = 6 * rounding * _felt(x.legs.M, with_base)
    for o, (X, a) in enumerate(zip(x.X, x.a_maps, strict=True)):
        out += congruence(X - np.matmul(a, x.G), noise[:, o])
        out += rounding**2 * _felt(x.I_star[:, o], np.abs(X) + np.abs(a) @ G)
    return out


def rounding_of(inertia: Array) -> Array:
    """Compute upper bounds on the rounding of inertias, as inertias of shape (T, outputs, 6, 6).

    The error of an entry is at most eps sqrt(I_ii I_jj). Six times eps times the diagonal is a matrix that
    bounds all these errors.
    """
    diagonal = np.diagonal(inertia, axis1=2, axis2=3)
    return 6 * EPS * np.abs(diagonal)[..., None] * np.eye(6)


def force_of_slips(x: ArticulatedModule) -> Array:
    """Compute the largest force that rates of rounding bring onto a motion, shape (T,), [N m]."""
    m = x.state.mechanism
    unit, columns = m.reduction.col_scale, x.state.module.motor_columns
    joints = (np.abs(x.legs.f) + np.abs(x.legs.h)) @ unit + np.abs(x.tau) @ unit[columns]
    outputs = np.abs(x.beta_star).sum(axis=1) @ np.repeat([m.length, 1.0], 3)
    out: Array = _slips(x).max(axis=1, initial=0.0) * (joints + outputs)
    return out


def largest_term_of(x: ArticulatedModule) -> Array:
    """Compute the largest term in the sum Q_0, shape (T,), [N m]."""
    out = _size(x.basis.Psi, np.abs(x.f) + np.abs(x.legs.h) + np.abs(x.legs.f))
    for a, b in zip(x.a_maps, x.b, strict=True):
        out = np.maximum(out, _size(a, np.abs(b)))
    return out


def largest_term(x: ArticulatedModule, carried: Array) -> Array:
    """Compute the largest term in the sum u_dot = A_t^-1 Q_0 - G V_dot, shape (T,).

    The terms of Q_0 move at least the motion of the largest inertia.

    Args:
        x: The module's equation of motion.
        carried: G V_dot, shape (T, N).
    """
    resisted = np.square(x.inertia.R[:, :1, :1].max(axis=(1, 2), initial=0.0))
    out: Array = x.size / np.where(resisted > 0, resisted, np.inf) + np.abs(carried).max(axis=1, initial=0.0)
    return out


def _slips(x: ArticulatedModule) -> Array:
    """Compute the rates of rounding in each motion, without units, shape (T, N).

    A joint that a motion leaves at rest has such a rate in it, and moves what it carries. That is all the
    inertia of a motion that moves no mass, and all the force on it.
    """
    m, Psi = x.state.mechanism, x.basis.Psi
    if not m.closures.rows:
        return np.zeros(Psi.shape[::2])
    largest_rate = np.abs(Psi / m.reduction.col_scale[:, None]).max(axis=1, initial=0.0)
    out: Array = 4 * m.tree.nv * EPS / m.reduction.report.kept * largest_rate
    return out


def _inertia_of_slips(x: ArticulatedModule) -> Array:
    """Compute the inertia that rates of rounding bring into each motion, shape (T, N)."""
    m = x.state.mechanism
    joints = np.einsum("tii,i->t", x.legs.M[:, 6:, 6:], m.reduction.col_scale**2)
    outputs = np.einsum("toii,i->t", x.I_star, np.repeat([m.length**2, 1.0], 3))
    out: Array = np.square(_slips(x)) * (joints + outputs)[:, None]
    return out


def _felt(inertia: Array, terms: Array) -> Array:
    """Compute how much inertia a motion feels before its terms cancel, as a diagonal matrix, (T, 6, 6).

    Args:
        inertia: Inertia of what moves, shape (T, n, n).
        terms: Magnitudes of the terms of its motion per motion of the base, shape (T, n, 6).
    """
    root = np.sqrt(np.abs(np.diagonal(inertia, axis1=1, axis2=2)))
    out: Array = np.square(np.einsum("ti,tij->tj", root, terms))[:, :, None] * np.eye(6)
    return out


def _size(B: Array, force: Array) -> Array:
    """Compute the largest entry of abs(B)^T abs(force), shape (T,)."""
    out: Array = np.einsum("tij,ti->tj", np.abs(B), np.abs(force)).max(axis=1, initial=0.0)
    return out
