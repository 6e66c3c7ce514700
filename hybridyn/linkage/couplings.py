"""Couplings of a tree's joints: their constant rows and their residuals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..spatial import Array
from .tree import Tree


@dataclass(frozen=True)
class TreeCoupling:
    """A linear relation between joint positions of a tree: sum of coefficient x position = offset.

    Attributes:
        terms: Pairs (joint index in the tree, coefficient).
        offset: Right-hand side.
    """

    name: str
    terms: tuple[tuple[int, float], ...]
    offset: float


def coupling_rows(tree: Tree, couplings: Sequence[TreeCoupling]) -> Array:
    """Return the constant rows of couplings over the tree's freedoms, shape (couplings, nv)."""
    rows = np.zeros((len(couplings), tree.nv))
    for row, coupling in zip(rows, couplings, strict=True):
        for joint, coefficient in coupling.terms:
            row[tree.v_slices[joint]] += coefficient
    return rows


def coupling_residual(tree: Tree, coupling: TreeCoupling, q: Array) -> Array:
    """Compute the residual of a coupling, shape (T,), in the unit of coefficient times position."""
    total = np.full(len(q), -coupling.offset)
    for joint, coefficient in coupling.terms:
        total += coefficient * q[:, tree.q_slices[joint].start]
    return total
