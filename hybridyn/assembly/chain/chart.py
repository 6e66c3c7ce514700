"""Coordinates of the postures near one, along the motions that all rows leave open; derivatives of a value.

Derivatives are central differences. Each point is brought onto the rows by a few steps with the inverse at
the posture itself. A step makes what the rows miss smaller by an order of the way. So the derivatives are
exact but for the rounding and the order of the differences.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...linkage.elimination import least_norm, least_squares
from ...spatial import Array, Index
from .problem import ChainProblem, Split
from .second import Value

#: Steps and weights of differences that are alike on both sides.
Stencil = tuple[tuple[int, float], ...]
#: Step of differences [rad, module lengths]: of order six, and of order two, where few digits suffice.
STEP, ROUGH_STEP = 1e-2, 1e-3
#: First and second derivatives of order six, the latter also of order two: steps and weights, on both sides.
SLOPE = ((1, 3 / 4), (2, -3 / 20), (3, 1 / 60))
CURVE, ROUGH_CURVE = ((1, 3 / 2), (2, -3 / 20), (3, 1 / 90)), ((1, 1.0),)
#: Number of points that are computed at once: more take memory.
AT_ONCE = 2000


@dataclass(frozen=True, eq=False)
class ValueChart:
    """Postures near some others, one for each sample.

    Attributes:
        problem: Rows and free freedoms.
        value: The value.
        q: The postures, shape (T, nq).
        samples: Their indices into the problem's known motions, shape (T,).
        motions: Motions that all rows leave open, scaled, the largest entry 1, shape (T, nv, left).
        inverse: Least motions that change the rows by one, scaled, shape (T, nv, rows).
    """

    problem: ChainProblem
    value: Value
    q: Array
    samples: Index
    motions: Array
    inverse: Array

    def gradient(self, corrections: int = 0) -> Array:
        """Compute the first derivatives, shape (T, left), by order six."""
        n = self.motions.shape[2]
        out = np.zeros((len(self.q), n))
        either_way = self._either_way(STEP * np.eye(n), SLOPE, corrections)
        for (_, weight), (ahead, behind) in zip(SLOPE, either_way, strict=True):
            out += weight / STEP * (ahead - behind)
        return out

    @cached_property
    def curvature(self) -> Array:
        """The second derivatives, shape (T, left, left), by order six."""
        return self.hessian()

    def hessian(self, *, rough: bool = False) -> Array:
        """Compute the second derivatives, shape (T, left, left), by order six, or two if `rough`."""
        n = self.motions.shape[2]
        pairs = np.array([(i, j) for i in range(n) for j in range(i + 1)], dtype=int).reshape(-1, 2)
        ways = np.minimum(1.0, np.eye(n)[pairs[:, 0]] + np.eye(n)[pairs[:, 1]])
        h, stencil = (ROUGH_STEP, ROUGH_CURVE) if rough else (STEP, CURVE)
        here, along = self._values(np.zeros((1, n)), 1), np.zeros((len(self.q), len(pairs)))
        for (_, weight), (ahead, behind) in zip(stencil, self._either_way(h * ways, stencil, 1), strict=True):
            along += weight / h**2 * (ahead + behind - 2.0 * here)
        out = np.zeros((len(self.q), n, n))
        out[:, pairs[:, 0], pairs[:, 1]] = along
        own = np.diagonal(out, axis1=1, axis2=2).copy()
        mixed = (along - own[:, pairs[:, 0]] - own[:, pairs[:, 1]]) / 2.0
        mixed[:, pairs[:, 0] == pairs[:, 1]] = own
        out[:, pairs[:, 0], pairs[:, 1]] = mixed
        out[:, pairs[:, 1], pairs[:, 0]] = mixed
        return out

    def spread(self, y: Array) -> Array:
        """Return the scaled motion, shape (T, nv), by its coordinates, shape (T, left)."""
        out: Array = np.einsum("tij,tj->ti", self.motions, y)
        return out

    def _either_way(self, y: Array, stencil: Stencil, corrections: int) -> Array:
        """Compute the value at steps of a stencil along ways (P, left) and back, shape (steps, 2, T, P)."""
        points = np.concatenate([sign * steps * y for steps, _ in stencil for sign in (1, -1)])
        values = self._values(points, corrections).reshape(len(self.q), len(stencil), 2, len(y))
        return values.transpose(1, 2, 0, 3)

    def _values(self, y: Array, corrections: int) -> Array:
        """Compute the value at points, coordinates of shape (P, left); shape (T, P)."""
        T, P = len(self.q), len(y)
        each = max(1, AT_ONCE // P)
        return np.concatenate([
            self._some(np.arange(start, min(T, start + each)), y, corrections)
            for start in range(0, T, each)
        ])  # fmt: skip

    def _some(self, at: Index, y: Array, corrections: int) -> Array:
        """Compute the value of some samples at points."""
        problem, P = self.problem, len(y)
        q, samples = np.repeat(self.q[at], P, axis=0), np.repeat(self.samples[at], P)
        way = np.einsum("tij,pj->tpi", self.motions[at], y)
        q = problem.tree.integrate(q, way.reshape(len(q), -1) * problem.col_scale)
        for _ in range(corrections):
            missed = problem.residual(q, samples).reshape(len(at), P, -1)
            back = np.einsum("tij,tpj->tpi", self.inverse[at], missed).reshape(len(q), -1)
            q = problem.tree.integrate(q, -back * problem.col_scale)
        return self.value(problem, q, samples).reshape(len(at), P)


def chart_at(
    problem: ChainProblem, value: Value, q: Array, samples: Index, motors: Index, left: int
) -> ValueChart:
    """Return the chart about postures, shape (T, nq).

    Args:
        problem: Rows and free freedoms.
        value: The value.
        samples: Index of each posture into the problem's known motions, shape (T,).
        motors: Freedoms of the motors.
        left: Number of motions that the rows leave open and that move motors.
    """
    problem = problem.unweighted
    split = problem.split(problem.matrix(problem.tree.sweep(q), samples))
    motions = _open_motions(problem, split, motors, left)
    return ValueChart(problem, value, q, samples, motions, _inverse(problem, split))


def _open_motions(problem: ChainProblem, split: Split, motors: Index, left: int) -> Array:
    """Return motions that all rows leave open, less idle ones, scaled, shape (T, nv, left)."""
    kept = np.swapaxes(np.linalg.svd(split.reach, full_matrices=True)[2][:, problem.rank or 0 :], 1, 2)
    each, at = [], 0
    for N in split.bases:
        each.append(np.matmul(N, kept[:, at : at + N.shape[2]]))
        at += N.shape[2]
    Z = np.concatenate(each, axis=1)
    Z = np.matmul(Z, np.swapaxes(np.linalg.svd(Z[:, motors])[2][:, :left], 1, 2))
    out: Array = Z / np.abs(Z).max(axis=1, keepdims=True)
    return out


def _inverse(problem: ChainProblem, split: Split) -> Array:
    """Return the least motions that change each row by one, scaled, shape (T, nv, rows)."""
    rows, each = split.rows, []
    T, count = len(split.reach), split.reach.shape[1]
    own = [K.shape[1] for K in rows.own]
    before = 0
    for part, K, found in zip(problem.parts, rows.own, split.factors, strict=True):
        block = np.zeros((T, part.tree.nv, sum(own) + count))
        if found is not None:
            one = np.broadcast_to(np.eye(K.shape[1]), (T, K.shape[1], K.shape[1]))
            block[:, part.free, before : before + K.shape[1]] = least_norm(found, one, rank=part.rank)
        each.append(block)
        before += K.shape[1]
    missed = -sum(np.matmul(J, block) for J, block in zip(rows.targets, each, strict=True))
    missed[:, :, sum(own) :] += np.eye(count)
    y, at = least_squares(split.reach, missed, rank=problem.rank), 0
    for k, N in enumerate(split.bases):
        each[k] = each[k] + np.matmul(N, y[:, at : at + N.shape[2]])
        at += N.shape[2]
    return np.concatenate(each, axis=1)
