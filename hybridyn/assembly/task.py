"""The problem of closing one module's loops at every sample of a trajectory."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..linkage.newton import RESIDUAL_ROUNDING, SMALLEST_STEP, Closed, LoopProblem, close
from ..spatial import Array, Index, Mask

#: Rows that contradict one another within the tolerance are accepted if their reciprocal condition number
#: is above this.
CONTRADICTING_RANK = 1e-9


@dataclass(frozen=True, eq=False)
class Task:
    """A problem at every sample of a trajectory.

    Attributes:
        problem: Rows and free freedoms.
        known: Positions, shape (T, nq); only those of the joints in `given` are used.
        given: Indices of the joints whose positions are given.
        tolerance: Largest scaled residual of a closed posture.
        module: The module's name, for messages.
        row_names: Name of each row's closure, coupling or target, for messages.
    """

    problem: LoopProblem
    known: Array
    given: Sequence[int]
    tolerance: float
    module: str
    row_names: Sequence[str]

    def with_known(self, q: Array, samples: Index) -> Array:
        """Return positions with the given joints set to their values."""
        q = q.copy()
        for joint in self.given:
            at = self.problem.tree.q_slices[joint]
            q[:, at] = self.known[samples, at]
        return q

    def solve(self, q: Array, samples: Index) -> Closed:
        """Close the loops from starts q, with the given joints at their values."""
        return close(self.problem, self.with_known(q, samples), samples)

    def closed(self, result: Closed) -> Mask:
        """Check which samples converged and closed, shape (T,)."""
        settled = (result.step <= SMALLEST_STEP) | (result.residual <= RESIDUAL_ROUNDING)
        out: Mask = settled & (result.residual <= self.tolerance)
        doubtful = np.flatnonzero(out & (result.residual > RESIDUAL_ROUNDING))
        if len(doubtful) and self.problem.rank:
            # Where rows lose rank, a zero step proves nothing: the target may be just out of reach.
            K = self.problem.matrix(self.problem.tree.sweep(result.q[doubtful]))[:, :, self.problem.free]
            s = np.linalg.svd(K, compute_uv=False)
            out[doubtful] = s[:, self.problem.rank - 1] > CONTRADICTING_RANK * s[:, 0]
        return out

    def between(self, sample: int, fractions: Array) -> Task:
        """Interpolate the task from a sample to the next, one new sample per fraction, shape (n,)."""
        tree = self.problem.tree
        start = np.tile(self.known[sample], (len(fractions), 1))
        whole = tree.difference(self.known[sample : sample + 1], self.known[sample + 1 : sample + 2])
        known = tree.integrate(start, fractions[:, None] * whole)
        known[fractions == 1.0] = self.known[sample + 1]
        targets = [t.between(sample, fractions) for t in self.problem.targets]
        return replace(self, problem=replace(self.problem, targets=targets), known=known)
