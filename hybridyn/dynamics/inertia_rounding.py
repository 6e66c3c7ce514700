"""Inertia and force that rounding brings into the motions of modules in the backward recursion."""

from __future__ import annotations

import numpy as np

from ..linkage.reduction import Basis
from ..spatial import Array
from ..structure.state import ModuleState
from .balance import LegTerms
from .inertia_solve import EPS


def slips_of(s: ModuleState, basis: Basis) -> Array:
    """Compute the rates of rounding in each motion, without units, shape (T, N).

    A joint that a motion leaves at rest has such a rate in it, and moves what it carries. That is all the
    inertia of a motion that moves no mass, and all the force on it.
    """
    m = s.mechanism
    if not m.closures.rows:
        return np.zeros(basis.Psi.shape[::2])
    largest_rate = np.abs(basis.Psi / m.reduction.col_scale[:, None]).max(axis=1, initial=0.0)
    out: Array = 4 * m.tree.nv * EPS / m.reduction.report.kept * largest_rate
    return out


def inertia_of_slips(s: ModuleState, legs: LegTerms, slips: Array, I_star: Array) -> Array:
    """Compute the inertia that rates of rounding bring into each motion, shape (T, N)."""
    joints = np.einsum("tii,i->t", legs.M[:, 6:, 6:], s.mechanism.reduction.col_scale**2)
    outputs = np.einsum("toii,i->t", I_star, np.repeat([s.mechanism.length**2, 1.0], 3))
    out: Array = np.square(slips) * (joints + outputs)[:, None]
    return out


def force_of_slips(s: ModuleState, legs: LegTerms, slips: Array, tau: Array, beta_star: Array) -> Array:
    """Compute the largest force that rates of rounding bring onto a motion, shape (T,)."""
    unit = s.mechanism.reduction.col_scale
    joints = (np.abs(legs.f) + np.abs(legs.h)) @ unit + np.abs(tau) @ unit[s.module.motor_columns]
    outputs = np.abs(beta_star).sum(axis=1) @ np.repeat([s.mechanism.length, 1.0], 3)
    out: Array = slips.max(axis=1, initial=0.0) * (joints + outputs)
    return out


def cancelled_inertia(inertia: Array, terms: Array, freedoms: int) -> Array:
    """Compute the inertia that the rounding of a motion feigns, as a matrix of shape (T, 6, 6).

    A motion in which a body does not take part is a difference of equal terms: its rounding d gives d^T I d.
    Without mass of its own, the base would seem to have this inertia.

    Args:
        inertia: Inertia of what moves, shape (T, n, n).
        terms: Magnitudes of the terms of its motion per motion of the base, shape (T, n, 6).
        freedoms: Number of freedoms of the module.
    """
    root = np.sqrt(np.abs(np.diagonal(inertia, axis1=1, axis2=2)))
    slip = (freedoms + 2) * EPS * np.einsum("ti,tij->tj", root, terms)
    out: Array = np.square(slip)[:, :, None] * np.eye(6)
    return out


def rounding_of(inertia: Array) -> Array:
    """Compute upper bounds on the rounding of inertias, as inertias of shape (T, outputs, 6, 6).

    The error of an entry is at most eps sqrt(I_ii I_jj). Six times eps times the diagonal is a matrix that
    bounds all these errors.
    """
    diagonal = np.diagonal(inertia, axis1=2, axis2=3)
    return 6 * EPS * np.abs(diagonal)[..., None] * np.eye(6)
