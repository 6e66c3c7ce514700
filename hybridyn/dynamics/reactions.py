"""Wrenches between modules and in the closures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..linkage.closures import TreeClosure
from ..linkage.tree import Motion
from ..spatial import Array, Mask, cross, rotate, rotate_back
from .lost_rank import LOST_PIVOT

if TYPE_CHECKING:
    from ..structure.mechanism import Mechanism
    from ..structure.state import ModuleState
    from .loads import ModuleLoad


#: Part of a unit wrench that does nothing from which on it leaves a component undetermined.
UNDETERMINED = 1e-6


@dataclass
class Reactions:
    """Internal wrenches, [force; moment] in [N, N m]; leading axis T dropped for a single sample.

    Attributes:
        base: Wrench that the ground exerts ON the root body, shape (T, 6), root frame, at its origin. Zero
            for a floating base, up to rounding, when the motion obeys the dynamics.
        modules: For each module by name, the wrench that its base body exerts ON it (the paper's F_k with the
            legs' share), shape (T, 6), in the base body's frame, at its origin.
        closures: For each closure by name, the wrench that it exerts ON its successor link (the predecessor
            gets the opposite), shape (T, 6), in the axes of the predecessor's closure frame as its author
            placed it, whatever the closure's axis, at the origin of the successor's closure frame; for a
            coupling, shape (T, 1), the multiplier of its relation as written.
        unique: For each closure, False where the motion does not determine its wrench, because rows are
            redundant or lose rank at a sample: then of all wrenches in the module's closures that make the
            motion, the least are given (norm of moments, and of forces times the module's length).
        determined: For each closure, which components of its wrench the motion determines all the same, shape
            (T, 6), or (T, 1) for a coupling: for a planar loop the forces in its plane.
    """

    base: Array
    modules: dict[str, Array]
    closures: dict[str, Array]
    unique: dict[str, bool]
    determined: dict[str, Mask]

    @classmethod
    def empty(cls, samples: int) -> Reactions:
        """Build reactions that are zero."""
        return cls(np.zeros((samples, 6)), {}, {}, {}, {})

    def sample(self, t: int) -> Reactions:
        """Return the reactions at one sample."""
        return Reactions(
            self.base[t],
            {name: w[t] for name, w in self.modules.items()},
            {name: w[t] for name, w in self.closures.items()},
            {name: bool(d[t].all()) for name, d in self.determined.items()},
            {name: d[t] for name, d in self.determined.items()},
        )


def module_reactions(
    result: Reactions, state: ModuleState, load: ModuleLoad, F: Array, force: Array, tau: Array
) -> None:
    """Enter one module's reactions.

    Args:
        result: What to fill in.
        state: The module's state.
        load: Wrenches on its bodies.
        F: Wrench of the base on the module, shape (T, 6), base frame.
        force: Generalised force that the motion needs along x, shape (T, n).
        tau: Efforts of the module's motors, shape (T, motors).
    """
    module, m = state.module, state.mechanism
    result.modules[module.name] = F
    if not m.closures.rows:
        return
    needed = force.copy()
    needed[:, module.motor_columns] -= tau
    multipliers, idle = _multipliers(state, needed)
    authors = len(m.spec.closures)
    for i, (name, at) in enumerate(module.named_rows()):
        lam, free = multipliers[:, at], idle[:, at]
        if i < authors:
            author = m.spanning_closures.closures[i]

            def wrench(
                x: Array, cut: TreeClosure = m.closures.closures[i], author: TreeClosure = author
            ) -> Array:
                return _closure_wrench(state, cut, author, x)

            lam = wrench(lam) + _from_cut_wrists(state, load, author)
            free = _each(wrench, free)
            free[:, :3] *= m.length
        elif i < len(m.closures.closures):
            continue  # a wrist that carries a platform is a joint, not a closure of the author's
        else:
            free = free / m.reduction.row_scale[at][:, None]
        result.closures[name] = lam
        result.determined[name] = np.abs(free).max(axis=2, initial=0.0) <= UNDETERMINED
        result.unique[name] = bool(result.determined[name].all())


def _multipliers(state: ModuleState, needed: Array) -> tuple[Array, Array]:
    """Return what a module's rows transmit, and what they may transmit besides without any motion.

    Args:
        state: The module's state.
        needed: Generalised force along x that closures have to give, shape (T, n).

    Returns:
        The multipliers, of least norm in the author's rows, shape (T, rows), and an orthonormal basis of
        those that do nothing, scaled likewise and filled up with zeros, shape (T, rows, k).
    """
    reduction = state.mechanism.reduction
    rows, rank = len(reduction.row_scale), reduction.rank
    U, s, Vt = np.linalg.svd(reduction.scaled(state.K), full_matrices=rank < rows)
    keep = (np.arange(s.shape[1]) < rank) & (s > LOST_PIVOT * s[:, :1])
    y = np.einsum("tij,tj->ti", Vt[:, : s.shape[1]], needed * reduction.col_scale)
    lam = np.einsum("tij,tj->ti", U[:, :, : s.shape[1]], np.where(keep, y / np.where(keep, s, 1.0), 0.0))
    kept = keep.sum(axis=1)
    first = int(kept.min(initial=rank))
    idle = U[:, :, first:] * np.where(np.arange(first, U.shape[2]) >= kept[:, None], 1.0, 0.0)[:, None]
    carried = _carrying_rows(state.mechanism)
    if carried.any() and idle.size:
        change = np.linalg.pinv(idle[:, ~carried], rcond=UNDETERMINED) @ lam[:, ~carried, None]
        lam -= np.matmul(idle, change)[..., 0]
    return lam * reduction.row_scale, idle * reduction.row_scale[:, None]


def _carrying_rows(mechanism: Mechanism) -> Mask:
    """Say which rows stand for a joint that carries a platform: none of the author's, shape (rows,)."""
    closures = mechanism.closures
    out = np.zeros(closures.rows, dtype=bool)
    for at in closures.row_slices[len(mechanism.spec.closures) : len(closures.closures)]:
        out[at] = True
    return out


def _each(function: Callable[[Array], Array], columns: Array) -> Array:
    """Apply a function of (T, rows) to every column of (T, rows, k); give (T, 6, k)."""
    parts = [function(columns[:, :, i]) for i in range(columns.shape[2])]
    return np.stack(parts, axis=2) if parts else np.zeros((len(columns), 6, 0))


def _closure_wrench(state: ModuleState, cut: TreeClosure, author: TreeClosure, lam: Array) -> Array:
    """Turn multipliers of a closure's rows into the wrench on the author's successor, shape (T, 6)."""
    A, _, B, pb = _frames(state.motion, cut)
    force = np.einsum("tij,tj->ti", A[:, :, cut.translations], lam[:, : len(cut.translations)])
    rest = lam[:, len(cut.translations) :]
    if cut.rotation == "fixed":
        moment = rotate(A, rest)
    elif cut.rotation == "free":
        moment = np.zeros_like(force)
    else:
        axes = [0, 1] if cut.rotation == "parallel" else [2]
        normals = np.stack([cross(B[:, :, 2], A[:, :, i]) for i in axes], axis=1)
        moment = np.einsum("tij,ti->tj", normals, rest)
    A_out, p_out = _wrench_frame(state.spanning, author)
    moment = moment + cross(pb - p_out, force)
    # A wrist that was cut keeps the author's sense: from its chain's side to the target, or back.
    numbers = state.mechanism.cut.bodies
    sign = 1.0 if numbers[cut.body_b] == author.body_b or numbers[cut.body_a] == author.body_a else -1.0
    return sign * np.concatenate([rotate_back(A_out, force), rotate_back(A_out, moment)], axis=-1)


def _from_cut_wrists(state: ModuleState, load: ModuleLoad, author: TreeClosure) -> Array:
    """Compute the wrench of a cut wrist's own links on the author's successor, shape (T, 6)."""
    out = np.zeros_like(state.V)
    for number, wrist in enumerate(state.mechanism.spec.wrists):
        if wrist.carries or {wrist.end, wrist.target} != {author.body_a, author.body_b}:
            continue
        handed = load.through_wrist(state, number)
        A, p = _wrench_frame(state.spanning, author)
        moment = handed[:, 3:] + cross(state.spanning.p[:, wrist.end] - p, handed[:, :3])
        sign = 1.0 if wrist.target == author.body_b else -1.0
        out += sign * np.concatenate([rotate_back(A, handed[:, :3]), rotate_back(A, moment)], axis=-1)
    return out


def _wrench_frame(motion: Motion, author: TreeClosure) -> tuple[Array, Array]:
    """Return the axes and the origin in the base in which a closure's wrench is expressed.

    The axes are those of the predecessor's frame as its author placed it (z of frame A is the closure's
    axis), the origin is the successor's.
    """
    A, _, _, p = _frames(motion, author)
    return A @ author.turn.T, p


def _frames(motion: Motion, c: TreeClosure) -> tuple[Array, Array, Array, Array]:
    """Return axes and origins of a closure's frames A and B in the base, shapes (T, 3, 3), (T, 3), twice."""
    Ra, Rb = motion.R[:, c.body_a], motion.R[:, c.body_b]
    return Ra @ c.R_a, motion.p[:, c.body_a] + Ra @ c.p_a, Rb @ c.R_b, motion.p[:, c.body_b] + Rb @ c.p_b
