"""Wrenches between modules and in the closures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .closure import TreeClosure
from .kinematics import Motion
from .spatial import Array, cross, rotate, rotate_back

if TYPE_CHECKING:
    from .forward import ModuleState
    from .loads import ModuleLoad


@dataclass
class Reactions:
    """Internal wrenches, [force; moment] in [N, N m]; leading axis T dropped for a single sample.

    Attributes:
        base: Wrench that the ground exerts ON the root body, shape (T, 6), root frame, at its origin. Zero
            for a floating base, up to rounding, when the motion obeys the dynamics.
        modules: For each module by name, the wrench that its base body exerts ON it (the paper's F_k with the
            legs' share), shape (T, 6), in the base body's frame, at its origin.
        closures: For each closure by name, the wrench that it exerts ON its successor link (the predecessor
            gets the opposite), shape (T, 6), in the axes of the predecessor's closure frame, at the origin of
            the successor's closure frame; for a coupling, shape (T, 1), the multiplier of its relation as
            written.
        unique: For each closure, False where its module has more rows than rank: then only the sum over the
            module's closures is determined, and the least-norm wrench is given.
    """

    base: Array
    modules: dict[str, Array]
    closures: dict[str, Array]
    unique: dict[str, bool]

    @classmethod
    def empty(cls, samples: int) -> Reactions:
        """Give reactions to be filled in."""
        return cls(np.zeros((samples, 6)), {}, {}, {})

    def sample(self, t: int) -> Reactions:
        """Give the reactions at one sample."""
        return Reactions(
            self.base[t],
            {name: w[t] for name, w in self.modules.items()},
            {name: w[t] for name, w in self.closures.items()},
            self.unique,
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
    reduction = m.reduction
    K = reduction.scaled(state.K)
    U, s, Vt = np.linalg.svd(K, full_matrices=False)
    keep = (np.arange(s.shape[1]) < reduction.rank) & (s > 0)
    y = np.einsum("tij,tj->ti", Vt, needed * reduction.col_scale)
    multipliers = (
        np.einsum("tij,tj->ti", U, np.where(keep, y / np.where(keep, s, 1.0), 0.0)) * reduction.row_scale
    )
    unique = reduction.rank == m.closures.rows
    authors = len(m.spec.closures)
    for i, (name, at) in enumerate(module.named_rows()):
        lam = multipliers[:, at]
        if i < authors:
            author = m.spanning_closures.closures[i]
            lam = _closure_wrench(state, m.closures.closures[i], author, lam) + _handed_on(
                state, load, author
            )
        elif i < len(m.closures.closures):
            continue  # a wrist that carries a platform is a joint, not a closure of the author's
        result.closures[name], result.unique[name] = lam, unique


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
    A_out, _, _, p_out = _frames(state.spanning, author)
    moment = moment + cross(pb - p_out, force)
    # A wrist that was cut keeps the author's sense: from its chain's side to the target, or back.
    numbers = state.mechanism.bodies
    sign = 1.0 if numbers[cut.body_b] == author.body_b or numbers[cut.body_a] == author.body_a else -1.0
    return sign * np.concatenate([rotate_back(A_out, force), rotate_back(A_out, moment)], axis=-1)


def _handed_on(state: ModuleState, load: ModuleLoad, author: TreeClosure) -> Array:
    """Give what a cut wrist hands from wrenches on its own links to the author's successor, shape (T, 6)."""
    out = np.zeros_like(state.V)
    for number, wrist in enumerate(state.mechanism.spec.wrists):
        if wrist.carries or {wrist.end, wrist.target} != {author.body_a, author.body_b}:
            continue
        handed = load.through_wrist(state, number)
        A, _, _, p = _frames(state.spanning, author)
        moment = handed[:, 3:] + cross(state.spanning.p[:, wrist.end] - p, handed[:, :3])
        sign = 1.0 if wrist.target == author.body_b else -1.0
        out += sign * np.concatenate([rotate_back(A, handed[:, :3]), rotate_back(A, moment)], axis=-1)
    return out


def _frames(motion: Motion, c: TreeClosure) -> tuple[Array, Array, Array, Array]:
    """Give axes and origins of a closure's frames A and B in the base, shapes (T, 3, 3), (T, 3), twice."""
    Ra, Rb = motion.R[:, c.body_a], motion.R[:, c.body_b]
    return Ra @ c.R_a, motion.p[:, c.body_a] + Ra @ c.p_a, Rb @ c.R_b, motion.p[:, c.body_b] + Rb @ c.p_b
