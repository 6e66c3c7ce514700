"""The designs of a study: values of its parameters. Design i is the same however the work is divided."""

from __future__ import annotations

import numpy as np
from scipy.special import ndtri

from ...spatial import Array, Index
from ...tables.opening import read_columns
from .study_file import MOST_DESIGNS, ParameterTable, StudyFile

#: Smallest probability: a normal distribution is unbounded at 0 and 1.
LEAST = 2.0**-53
#: Ends of a range that is not stated, as that of a list of values.
UNIT = (0.0, 1.0)


class Designs:
    """The designs of a study, numbered from 0.

    A table and a Latin hypercube are kept in memory, 8 bytes per number; others are drawn when asked for.

    Attributes:
        names: Names of the parameters.
        count: Number of designs.
    """

    def __init__(self, source: StudyFile) -> None:
        """Prepare the designs.

        Raises:
            ModelError: A grid is too large.
            TrajectoryError: The table is wrong, or a parameter has no column.
        """
        self.source, self.parameters = source, source.study.parameters
        self.names = list(self.parameters)
        self.method, self.seed = source.study.designs.method, source.study.designs.seed
        self._all: Array | None = None
        if self.method == "grid":
            self._axes = [_axis(one) for one in self.parameters.values()]
            self.count = int(np.prod([len(axis) for axis in self._axes], dtype=object))
            if self.count > MOST_DESIGNS:
                raise source.error(("designs", "method"), f"a grid of {self.count:,} designs is too large")
        elif self.method == "table":
            self._all = read_columns(source.beside(source.study.designs.table or ""), self.names)
            self.count = len(self._all)
        else:
            self.count = source.study.designs.count or 0
        if self.method == "latin_hypercube":
            from scipy.stats import qmc  # imported where it is needed: it takes a second

            self._all = qmc.LatinHypercube(len(self.names), seed=self.seed).random(self.count)

    def values(self, start: int, stop: int) -> Array:
        """Return the parameters of the designs from `start` to before `stop`, shape (designs, parameters)."""
        numbers = np.arange(start, stop)
        if self.method == "grid":
            places = np.unravel_index(numbers, [len(axis) for axis in self._axes])
            return np.column_stack([axis[at] for axis, at in zip(self._axes, places, strict=True)])
        unit = self._unit(numbers)
        if self.method == "table":
            return unit
        columns = zip(unit.T, self.parameters.values(), strict=True)
        return np.column_stack([_quantile(part, one) for part, one in columns])

    def _unit(self, numbers: Index) -> Array:
        """Return points of the unit cube, shape (designs, parameters)."""
        if self._all is not None:
            return self._all[numbers]
        size = len(self.names)
        if self.method == "random":
            return np.array([generator(self.seed, int(i)).random(size) for i in numbers]).reshape(-1, size)
        from scipy.stats import qmc

        engine = qmc.Sobol(size, seed=self.seed)
        if not len(numbers):
            return np.empty((0, size))
        # One point first: SciPy's remark on counts that are no power of 2 belongs to one call for all points.
        first = int(numbers[0])
        parts = [engine.random(1)] if first == 0 else []
        if first:
            engine.fast_forward(first)
        rest = len(numbers) - len(parts)
        return np.concatenate([*parts, engine.random(rest)] if rest else parts)


def generator(seed: int, design: int) -> np.random.Generator:
    """Return the random numbers of a design: `SeedSequence(seed).spawn(n)[design]`, without the others."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(design,)))


def _axis(one: ParameterTable) -> Array:
    """Return the values of a parameter on a grid."""
    if one.values is not None:
        return np.array(one.values)
    lower, upper = one.range or UNIT
    return np.linspace(lower, upper, one.steps or 1)


def _quantile(unit: Array, one: ParameterTable) -> Array:
    """Map numbers of the unit interval to a parameter's distribution."""
    if one.values is not None:
        values = np.array(one.values)
        drawn: Array = values[np.minimum((unit * len(values)).astype(int), len(values) - 1)]
        return drawn
    if one.normal is not None:
        mean, deviation = one.normal
        out: Array = mean + deviation * ndtri(np.clip(unit, LEAST, 1 - LEAST))
        return out
    lower, upper = one.range or UNIT
    return lower + (upper - lower) * unit
