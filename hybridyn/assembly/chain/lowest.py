"""The task of a chain whose posture makes a value least, of all that meet the targets: Newton on both."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...errors import AT_SAMPLE, AssemblyError
from ...linkage.newton import Closed
from ...spatial import Array, Index, Mask
from .chart import ValueChart, chart_at
from .second import Value
from .task import ChainTask

#: Longest way of one step [rad, module lengths], and the shortest one that is tried.
LONGEST, SHORTEST = 0.1, 1e-7
#: A posture is lowest after a step below this: the next one is a millionth of it, or less.
LOWEST = 1e-9
#: Steps below this are not asked to lower the value, whose change is rounding.
LOWERED_ROUNDING = 1e-5
#: Largest deviation of a step from its prediction, relative to it.
AS_PREDICTED = 0.25
#: Slopes below this part of the curvature are level: there a step leaves a saddle.
LEVEL = 1e-7
#: Largest number of steps.
STEPS = 200


@dataclass(frozen=True, eq=False)
class LowestTask(ChainTask):
    """A task of a chain that leaves freedoms, and a value that these make least.

    Attributes:
        value: The value.
        motors: Freedoms of the motors that may move.
        rule: Name of the rule, for messages.
    """

    value: Value | None = None
    motors: Index | None = None
    rule: str = ""

    @property
    def redundant(self) -> bool:
        """Whether freedoms are left to the motion from row to row: the value takes them all."""
        return False

    def chart(self, q: Array, samples: Index) -> ValueChart:
        """Return the chart about postures, shape (T, nq), of some samples."""
        assert self.value is not None
        assert self.motors is not None
        return chart_at(self.problem, self.value, q, samples, self.motors, self.left)

    def solve(self, q: Array, samples: Index, *, enough: float = np.inf) -> Closed:
        """Meet the rows from starts q, then make the value least; if it cannot, the residual is infinite."""
        result = ChainTask.solve(self, q, samples, enough=enough)
        good = np.flatnonzero(ChainTask.closed(self, result))
        out, residual = result.q.copy(), result.residual.copy()
        out[good], lowest = self.lowered(result.q[good], samples[good])
        residual[good[~lowest]] = np.inf
        return result._replace(q=out, residual=residual)

    def lowered(self, q: Array, samples: Index) -> tuple[Array, Mask]:
        """Lower the value from postures that meet the rows, as far as it goes without leaving their branch.

        Returns:
            Postures, shape (T, nq), and whether the value is least there, shape (T,).
        """
        q, active, done = q.copy(), np.arange(len(q)), np.zeros(len(q), dtype=bool)
        limit = np.full(len(q), LONGEST)
        for _ in range(STEPS):
            if not len(active):
                break
            chart = self.chart(q[active], samples[active])
            way = _limited(chart, descent(chart), limit[active])
            there, good = self._stepped(chart, way)
            size = np.abs(way).max(axis=1, initial=0.0)
            q[active[good]] = there[good]
            limit[active] = np.where(good, np.minimum(2.0 * limit[active], LONGEST), size / 4.0)
            ended = good & (size <= LOWEST)
            done[active[ended]] = True
            active = active[~ended & (limit[active] > SHORTEST)]
        return q, done

    def _stepped(self, chart: ValueChart, way: Array) -> tuple[Array, Mask]:
        """Go a way, scaled, from a chart's postures; return where it ends, and where that is as predicted."""
        tree, scale = self.problem.tree, self.problem.col_scale
        start = tree.integrate(chart.q, way * scale)
        result = ChainTask.solve(self, start, chart.samples)
        off = np.abs(tree.difference(start, result.q) / scale).max(axis=1, initial=0.0)
        size = np.abs(way).max(axis=1, initial=0.0)
        good = ChainTask.closed(self, result) & (off <= AS_PREDICTED * size + LOWEST)
        assert self.value is not None
        before, after = (self.value(self.problem, q, chart.samples) for q in (chart.q, result.q))
        return result.q, good & ((after < before) | (size < LOWERED_ROUNDING))

    def predicted(self, q: Array, samples: Index) -> Array:
        """Return where one step of lowering leads from postures that nearly meet the rows, shape (T, nq)."""
        chart = self.chart(q, samples)
        way = chart.spread(descent(chart)) * self.problem.col_scale
        return np.asarray(self.problem.tree.integrate(q, way))

    def lost(self, sample: int, start: str) -> AssemblyError:
        """Build the error for a sample at which no least value continues that of a start."""
        return AssemblyError(
            f"{self.label}: redundancy '{self.rule}': no continuous motion leads to a least "
            f"posture{AT_SAMPLE} {start}. Hold joints, give another guess, or take another rule",
            module=self.module,
            sample=sample,
        )


def descent(chart: ValueChart) -> Array:
    """Compute the steps to where the value is least, shape (T, left): Newton's, downhill in each direction.

    Where the value is level, and curved downwards in a direction, the step goes there.
    """
    slope, (curvature, axes) = chart.gradient(), np.linalg.eigh(chart.hessian(rough=True))
    along = np.einsum("tji,tj->ti", axes, slope)
    size = np.abs(curvature)
    largest = size.max(axis=1, keepdims=True, initial=0.0)
    step = -along / np.maximum(size, 1e-12 * largest)
    saddle = (curvature < -1e-6 * largest) & (np.abs(along) <= LEVEL * size)
    step[saddle] = LONGEST
    out: Array = np.einsum("tij,tj->ti", axes, step)
    return out


def _limited(chart: ValueChart, y: Array, limit: Array) -> Array:
    """Return the motion of a step, scaled, no longer than a limit, shape (T,)."""
    way = chart.spread(y)
    size = np.abs(way).max(axis=1, initial=0.0)
    return way * np.minimum(1.0, limit / np.where(size > 0.0, size, 1.0))[:, None]
