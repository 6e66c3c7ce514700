"""Couplings of joint positions of a tree: residual, constraint rows and drift term.

A coupling is one row, sum of coefficient x position + curve - offset = 0. A linear one has a constant row and
no drift. A curve, of hybridyn's own or the residual of another package, adds its slopes, and its drift is its
second derivative over time at constant rates.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from ..description.records import Curve
from ..spatial import Array, Mask, rotate

if TYPE_CHECKING:  # few robots have closures of other packages
    from ..description.residuals import Residual


class TreeCoupling(NamedTuple):
    """A relation between joint positions of a tree (defined in `description.records.Coupling`).

    Attributes:
        terms: Pairs (joint index in the tree, coefficient).
        offset: Right-hand side; of symbols an array, shape (1,).
        curve: What bends the relation, over joint indices; None if it is linear.
    """

    name: str
    terms: tuple[tuple[int, float], ...]
    offset: float | Array
    curve: Curve | Residual | None = None

    @property
    def form(self) -> tuple[object, ...]:
        """Everything but name and offset."""
        return self.terms, self.curve

    @property
    def sizes(self) -> list[tuple[int, float]]:
        """How strongly each joint counts: coefficients, and those of the curve, without sign."""
        bent = self.curve.sizes if self.curve else []
        return [(joint, abs(factor)) for joint, factor in self.terms] + bent

    def of(self, number: Mapping[int, int]) -> TreeCoupling:
        """Return the coupling of joints of other numbers, without its name."""
        terms = tuple((number[i], k) for i, k in self.terms)
        return self._replace(name="", terms=terms, curve=self.curve and self.curve.of(number))


class Slices(Protocol):
    """The slice of each joint of a tree."""

    def __getitem__(self, joint: int, /) -> slice:
        """Return the slice of a joint."""


class Places(Protocol):
    """Where the coordinates of a tree's joints are, as in `Tree`."""

    @property
    def nv(self) -> int:
        """Number of freedoms."""

    @property
    def q_slices(self) -> Slices:
        """Slice of q of each joint."""

    @property
    def v_slices(self) -> Slices:
        """Slice of v of each joint."""


class CouplingRows:
    """Residuals and rows of the couplings of a tree, on numbers or symbols.

    Attributes:
        constant: Rows over the tree's freedoms without curves, shape (couplings, nv).
    """

    def __init__(self, tree: Places, couplings: Sequence[TreeCoupling]) -> None:
        self._tree, self._couplings = tree, tuple(couplings)
        self.constant = np.zeros((len(couplings), tree.nv))
        self._bent = [(i, coupling.curve) for i, coupling in enumerate(couplings) if coupling.curve]
        self._kept: Mask = np.ones(tree.nv, dtype=bool)
        for i, coupling in enumerate(couplings):
            for joint, coefficient in coupling.terms:
                self.constant[i, tree.v_slices[joint]] += coefficient

    def moved_by(self, free: Mask) -> CouplingRows:
        """Return the couplings with rows filled in only for freedoms in the mask `free`, shape (nv,)."""
        out = copy(self)
        out.constant, out._kept = self.constant * free, self._kept & free
        return out

    def residual(self, q: Array) -> Array:
        """Compute the residuals, shape (T, couplings), in the unit of coefficient times position."""
        out = np.empty((len(q), len(self._couplings)), q.dtype)
        for i, coupling in enumerate(self._couplings):
            total = np.full(len(q), -coupling.offset, q.dtype)
            for joint, coefficient in coupling.terms:
                total += coefficient * q[:, self._tree.q_slices[joint].start]
            if coupling.curve:
                total += coupling.curve.value(self._positions(coupling.curve, q))
            out[:, i] = total
        return out

    def matrix(self, q: Array | None) -> Array:
        """Compute the rows at positions (T, nq): shape (couplings, nv) if none is bent, else (T, ...)."""
        if not self._bent:
            return self.constant
        assert q is not None
        out: Array = np.repeat(self.constant[None], len(q), axis=0).astype(q.dtype, copy=False)
        for i, curve in self._bent:
            for joint, slope in curve.slopes(self._positions(curve, q)).items():
                column = self._tree.v_slices[joint].start
                if self._kept[column]:
                    out[:, i, column] += slope
        return out

    def rates(self, q: Array | None, v: Array, a: Array | None) -> tuple[Array, Array]:
        """Compute the first two time derivatives of the residuals, each of shape (T, couplings).

        Args:
            q: Positions, shape (T, nq); None if no coupling is bent.
            v: Rates, shape (T, nv).
            a: Accelerations, shape (T, nv), or None for zero.
        """
        rows = self.matrix(q)
        if rows.ndim == 2:
            return v @ rows.T, np.zeros((len(v), len(rows))) if a is None else a @ rows.T
        assert q is not None
        first = rotate(rows, v)
        second = np.zeros_like(first) if a is None else rotate(rows, a)
        for i, curve in self._bent:
            rates = {joint: v[:, self._tree.v_slices[joint].start] for joint, _ in curve.terms}
            second[:, i] += curve.bend(self._positions(curve, q), rates)
        return first, second

    def _positions(self, curve: Curve | Residual, q: Array) -> dict[int, Array]:
        """Return the positions of the joints of a curve or residual, shape (T,) each."""
        return {j: q[:, self._tree.q_slices[j].start] for j, _ in curve.terms}
