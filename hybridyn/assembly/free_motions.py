"""Motions of a module that no motor drives, that are idle, or that have no inertia."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ..linkage.elimination import pivoted_qr
from ..linkage.motion import Motion
from ..spatial import Array, Mask
from ..structure.mechanism import Mechanism
from ..structure.module import Module

#: A motion is idle (a rod's spin) if it moves outputs, motors and centres of mass by less than this.
IDLE = 1e-6
#: A motion has no inertia below this part of the module's largest inertia (rounding of the sum is far less).
MASSLESS_MOTION = 1e-12
#: Motors drive a motion if their share in it is at least this.
DRIVEN = 1e-6


class FreeMotions(NamedTuple):
    """Motions at a generic posture, each named by the freedom that moves most.

    Attributes:
        uncontrolled: Motions that no motor drives and that move an output or a centre of mass.
        idle: Motions that no motor drives and that move neither (a rod that spins about its axis).
        massless: Motions without inertia: any force along them causes an infinite acceleration.
    """

    uncontrolled: tuple[str, ...]
    idle: tuple[str, ...]
    massless: tuple[str, ...]


def free_motions(module: Module) -> FreeMotions:
    """Compute the motions of a module that lack a motor or inertia."""
    m = module.mechanism
    if not m.mobility:
        return FreeMotions((), (), ())
    motion = m.tree.sweep(m.postures[:1])
    scaled = m.basis(m.closures.matrix(motion)).Psi[0] / m.reduction.col_scale[:, None]
    motions = np.linalg.qr(scaled)[0]  # orthonormal in scaled coordinates
    names = module.freedom_names()
    free, calm = _undriven(module, motions, effects(m, motion)[0])
    idle, moving = motions @ free @ calm, motions @ free @ _null_space(calm.T, DRIVEN)
    values, vectors = np.linalg.eigh(own_inertia(m, motions * m.reduction.col_scale[:, None]))
    light = motions @ vectors[:, values <= MASSLESS_MOTION * max(values[-1], 0.0)]
    return FreeMotions(_named(moving, names), _named(idle, names), _named(light, names))


def own_inertia(m: Mechanism, Psi: Array) -> Array:
    """Compute the inertia of a module alone, along motions at its first generic posture, shape (N, N).

    Args:
        m: The module's numbers.
        Psi: The motions, shape (n, N), of the tree after the cuts.
    """
    posture = m.postures[:1]
    motion = m.tree.sweep(posture)
    total: Array = Psi.T @ m.legs.crba(posture)[0, 6:, 6:] @ Psi
    for body, inertia in zip(m.spec.outputs, m.inertias, strict=True):
        a_map = m.jacobian(motion, body)[0] @ Psi
        total = total + a_map.T @ inertia @ a_map
    return total


def idle_motions(module: Module, motions: Array, motion: Motion) -> Iterator[Array]:
    """Yield, sample by sample, the combinations of motions that are idle: no motor drives them, no effect.

    Args:
        motions: Its motions, orthonormal in scaled coordinates, shape (T, n, N).
        motion: Motion of its tree, T samples.

    Returns:
        Orthonormal columns of shape (N, k), sample by sample.
    """
    for own, moved in zip(motions, effects(module.mechanism, motion), strict=True):
        free, calm = _undriven(module, own, moved)
        yield free @ calm


def are_idle(module: Module, motions: Array, motion: Motion) -> Mask:
    """Return the samples at which motions are idle: no combination moves an output or a centre of mass.

    Args:
        motions: The motions, orthonormal in scaled coordinates, shape (T, n, k).
        motion: Motion of its tree, T samples.
    """
    moved = np.matmul(effects(module.mechanism, motion) * module.mechanism.reduction.col_scale, motions)
    out: Mask = np.linalg.norm(moved, axis=(1, 2)) <= IDLE
    return out


def _undriven(module: Module, motions: Array, moved: Array) -> tuple[Array, Array]:
    """Compute the combinations of motions that no motor drives, and which of these have no effect.

    Args:
        motions: Its motions, orthonormal in scaled coordinates, shape (n, N).
        moved: Rows of `effects` at one sample, shape (rows, n).
    """
    free = _null_space(motions[module.motor_columns], DRIVEN)
    return free, _null_space(moved @ (motions @ free * module.mechanism.reduction.col_scale[:, None]), IDLE)


def effects(m: Mechanism, motion: Motion) -> Array:
    """Compute the scaled Jacobians of outputs, six rows each, then of the legs' centres of mass, three each.

    Args:
        motion: Motion of the tree after the cuts.

    Returns:
        Shape (T, rows, n).
    """
    units = np.array([m.length] * 3 + [1.0] * 3)[:, None]
    rows = [np.zeros((len(motion.p), 0, m.tree.nv))]
    rows += [m.tree.jacobian(motion, body) / units for body in m.spec.outputs]
    for i, body in enumerate(m.spec.leg_bodies):
        if body is not None and body.mass:
            centre = motion.p[:, i + 1] + motion.R[:, i + 1] @ body.com
            rows.append(m.tree.jacobian(motion, i + 1, centre)[:, :3] / m.length)
    return np.concatenate(rows, axis=1)


def _null_space(A: Array, tolerance: float) -> Array:
    """Compute an orthonormal basis of the null space of A to a tolerance, shape (n, k)."""
    if not A.shape[1]:
        return np.zeros((0, 0))
    _, s, Vt = np.linalg.svd(A, full_matrices=True)
    rank = int(np.sum(s > tolerance))
    return Vt[rank:].T


def _named(motions: Array, names: list[str]) -> tuple[str, ...]:
    """Name motions, columns of shape (n, k), by k freedoms that together distinguish them."""
    k = motions.shape[1]
    if not k:
        return ()
    order = pivoted_qr(motions.T[None], len(motions), k)[1][0, :k]
    return tuple(names[i] for i in sorted(order))
