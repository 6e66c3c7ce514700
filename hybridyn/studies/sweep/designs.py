"""The designs of a study: values of its parameters, drawn at once. Memory: 8 bytes per number."""

from __future__ import annotations

import math

import numpy as np
from scipy.special import ndtri

from ...spatial import Array
from ...tables.opening import read_columns
from .study_file import MOST_DESIGNS, ParameterTable, StudyFile

#: Smallest probability: a normal distribution is unbounded at 0 and 1.
LEAST = 2.0**-53
#: Ends of a range that is not stated, as that of a list of values.
UNIT = (0.0, 1.0)


def designs_of(source: StudyFile) -> Array:
    """Return the values of a study's parameters, shape (designs, parameters).

    Raises:
        ModelError: A grid is too large.
        TrajectoryError: The table is wrong, or a parameter has no column.
    """
    stated, parameters = source.study.designs, source.study.parameters
    if stated.method == "table":
        return read_columns(source.beside(stated.table or ""), list(parameters))
    if stated.method == "grid":
        axes = [_axis(one) for one in parameters.values()]
        count = math.prod(map(len, axes))
        if count > MOST_DESIGNS:
            raise source.error(("designs", "method"), f"a grid of {count:,} designs is too large")
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(count, len(axes))
    unit = _unit(stated.method, stated.count or 0, len(parameters), stated.seed)
    return np.column_stack([_quantile(*pair) for pair in zip(unit.T, parameters.values(), strict=True)])


def _unit(method: str, count: int, size: int, seed: int) -> Array:
    """Draw points of the unit cube, shape (count, size)."""
    if method == "random":
        return np.random.default_rng(seed).random((count, size))
    from scipy.stats import qmc  # imported where it is needed: it takes a second

    if method == "latin_hypercube":
        latin: Array = qmc.LatinHypercube(size, seed=seed).random(count)
        return latin
    sobol: Array = qmc.Sobol(size, seed=seed).random_base2((count - 1).bit_length())[:count]
    return sobol


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
