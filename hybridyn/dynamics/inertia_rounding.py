"""What rounding feigns in the direct model: inertia and force of motions that have none.

These bounds read what `direct_recursion` keeps of a module. A pivot of A_t that does not exceed them belongs
to a motion without inertia.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..spatial import Array
from .inertia_solve import EPS, congruence

if TYPE_CHECKING:
    from .direct_recursion import ArticulatedModule


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

    A motion in which a body does not take part is a difference of equal terms: its rounding d gives d^T I d.
    Without mass of its own, the base would seem to have this inertia.

    Args:
        x: The module's equation of motion.
        noise: As in `seeming`.
    """
    Psi, G = x.basis.Psi, x.G
    out = _cancelled(x.legs.M[:, 6:, 6:], np.abs(Psi) @ np.abs(G), Psi.shape[2])
    for o, (X, a) in enumerate(zip(x.X, x.a_maps, strict=True)):
        out += congruence(X - np.matmul(a, G), noise[:, o])
        out += _cancelled(x.I_star[:, o], np.abs(X) + np.abs(a) @ np.abs(G), Psi.shape[2])
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

    Args:
        x: The module's equation of motion.
        carried: G V_dot, shape (T, N).
    """
    size, kept = x.size, _largest(x.Q_0)
    resisted = np.square(x.inertia.R[:, :1, :1].max(axis=(1, 2), initial=0.0))
    terms = _largest(x.y) * np.maximum(size / np.where(kept > 0, kept, np.inf), 1.0)
    return np.maximum(terms, size / np.where(resisted > 0, resisted, np.inf)) + _largest(carried)


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


def _cancelled(inertia: Array, terms: Array, freedoms: int) -> Array:
    """Compute the inertia that the rounding of a motion feigns, as a matrix of shape (T, 6, 6).

    Args:
        inertia: Inertia of what moves, shape (T, n, n).
        terms: Magnitudes of the terms of its motion per motion of the base, shape (T, n, 6).
        freedoms: Number of freedoms of the module.
    """
    root = np.sqrt(np.abs(np.diagonal(inertia, axis1=1, axis2=2)))
    slip = (freedoms + 2) * EPS * np.einsum("ti,tij->tj", root, terms)
    out: Array = np.square(slip)[:, :, None] * np.eye(6)
    return out


def _largest(x: Array) -> Array:
    """Compute the largest absolute entry of each sample, shape (T,)."""
    out: Array = np.abs(x).max(axis=1, initial=0.0)
    return out


def _size(B: Array, force: Array) -> Array:
    """Compute the largest entry of abs(B)^T abs(force), shape (T,)."""
    out: Array = np.einsum("tij,ti->tj", np.abs(B), np.abs(force)).max(axis=1, initial=0.0)
    return out
