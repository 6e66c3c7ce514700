"""Bounds on the rounding of the direct model, beside its recursion: what has no digits, and what is refused.

`Rounding` goes along with the backward sweep: it bounds the inertia that rounding feigns in each motion. This
decides which motions are without inertia. All bounds are computed from what the recursion keeps of a module.
"""

from typing import Any

import numpy as np

from ..spatial import Array, congruence
from .articulated_module import ArticulatedModule
from .guards import EPS, FORCED, MASSLESS, check, check_digits
from .inertia_solve import InertiaFactor


class Rounding:
    """Bounds on the rounding of the articulated inertias of a robot, filled in from the outside inwards."""

    def __init__(self, I_star: list[Array]) -> None:
        """Start from the inertias of the outputs' bodies, shapes (T, outputs, 6, 6)."""
        self._noise = [np.zeros_like(x) for x in I_star]

    def factor(self, k: int, x: ArticulatedModule) -> InertiaFactor:
        """Factor A_t of module k; principal motions whose inertia is rounding are massless."""
        self._noise[k] += rounding_of(x.I_star)
        return InertiaFactor(x.A_t, seeming(x, self._noise[k]))

    def hand_on(self, k: int, x: ArticulatedModule) -> None:
        """Add what module k hands on to the bounds of the output that carries it."""
        module = x.state.module
        self._noise[module.parent][:, module.parent_output] += seeming_at_base(x, self._noise[k])


def check_massless(x: ArticulatedModule, left: Array) -> None:
    """Raise if a force acts on a motion without inertia.

    Args:
        x: The module's equation of motion.
        left: Forces on massless principal motions (`InertiaFactor.solve`), shape (T, N), [N m].

    Raises:
        SingularityError: The message names the motion, the force and the sample.
    """
    module, force = x.state.module, np.abs(left).max(axis=1, initial=0.0)

    def words(t: int) -> dict[str, Any]:
        """Name the motion and the force on it."""
        motion = x.basis.Psi[t] @ x.inertia.motions[t, :, np.argmax(np.abs(left[t]))]
        motion /= module.mechanism.reduction.col_scale
        freedom = module.freedom_names()[int(np.argmax(np.abs(motion)))]
        return {"what": "inertia", "condition": np.inf, "freedom": freedom, "force": force[t]}

    check(MASSLESS, module, force, np.maximum(largest_term_of(x), force_of_slips(x) / FORCED), words)


def check_accelerations(x: ArticulatedModule, carried: Array, x_ddot: Array, gravity: Array) -> None:
    """Raise or warn if the accelerations of a module have no correct digit.

    Args:
        x: The module's equation of motion.
        carried: G V_dot, shape (T, N).
        x_ddot: Accelerations of its tree, shape (T, n).
        gravity: Acceleration of gravity, shape (3,), [m/s^2].
    """
    m = x.state.mechanism
    natural = float(np.linalg.norm(gravity)) / m.length
    size = np.abs(x_ddot / m.reduction.col_scale).max(axis=1, initial=0.0)
    check_digits(x.state.module, "accelerations", "rad/s^2", size, largest_term(x, carried), natural)


def seeming(x: ArticulatedModule, noise: Array) -> Array:
    """Compute the inertia that rounding feigns in each motion of a module, shape (T, N).

    Args:
        x: The module's equation of motion.
        noise: Upper bounds on the rounding of I_star, as inertias, shape (T, outputs, 6, 6).
    """
    M, turned = np.abs(x.legs.M[:, 6:, 6:]), x.state.mechanism.turned_inertia
    joints = M + np.where(M > 0, np.diag(turned), 0.0)
    terms = congruence(np.abs(x.basis.Psi), joints)
    terms += congruence(np.abs(x.a_maps), np.abs(x.I_star)).sum(axis=1)
    carried = congruence(x.a_maps, noise).sum(axis=1)
    rounding = 4 * x.state.mechanism.tree.nv * EPS * terms + carried
    return np.diagonal(rounding, axis1=1, axis2=2) + _inertia_of_slips(x)


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
    out += congruence(x.X - np.matmul(x.a_maps, x.G[:, None]), noise).sum(axis=1)
    moved = np.abs(x.X) + np.matmul(np.abs(x.a_maps), G[:, None])
    out += rounding**2 * _felt(x.I_star, moved).sum(axis=1)
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
    joints = _size(x.basis.Psi, np.abs(x.f) + np.abs(x.legs.h) + np.abs(x.legs.f))
    out: Array = np.maximum(joints, _size(x.a_maps, x.b).max(axis=1, initial=0.0))
    return out


def largest_term(x: ArticulatedModule, carried: Array) -> Array:
    """Compute the largest term in the sum u_dot = A_t^-1 Q_0 - G V_dot, shape (T,).

    The terms of Q_0 move at least the motion of the largest inertia.

    Args:
        x: The module's equation of motion.
        carried: G V_dot, shape (T, N).
    """
    largest = np.diagonal(x.A_t, axis1=1, axis2=2).max(axis=1, initial=0.0)
    resisted = np.where(x.inertia.massless.all(axis=1), np.inf, largest)
    out: Array = largest_term_of(x) / resisted + np.abs(carried).max(axis=1, initial=0.0)
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
    """Compute how much inertia a motion feels before its terms cancel, as a diagonal matrix, (..., 6, 6).

    Args:
        inertia: Inertia of what moves, shape (..., n, n).
        terms: Magnitudes of the terms of its motion per motion of the base, shape (..., n, 6).
    """
    root = np.sqrt(np.abs(np.diagonal(inertia, axis1=-2, axis2=-1)))
    out: Array = np.square(np.einsum("...i,...ij->...j", root, terms))[..., None] * np.eye(6)
    return out


def _size(B: Array, force: Array) -> Array:
    """Compute the largest entry of abs(B)^T abs(force), shapes (..., n, N), (..., n) and (...)."""
    out: Array = np.einsum("...ij,...i->...j", np.abs(B), np.abs(force)).max(axis=-1, initial=0.0)
    return out
