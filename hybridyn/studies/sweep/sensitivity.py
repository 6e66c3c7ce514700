"""Sensitivity of the measures of a sweep to its parameters: first-order Sobol indices, by SALib.

The index of a parameter is the part of a measure's variance that this parameter alone explains. It is
estimated from the designs of a sweep as they are, from the means of the measure in classes of the parameter
(Plischke, Borgonovo and Smith, 2013). RBD-FAST would take the regular order of Sobol points for a dependence.
The parameters have to be independent, and designs that could not be evaluated are left out.
"""

from __future__ import annotations

from importlib import import_module
from os import PathLike
from typing import Any, NamedTuple

import numpy as np

from ...errors import HybridynError, install_advice
from .shards import about_of, read_shards

#: Fewest designs: with these the indices of a linear function are uncertain by 0.1.
FEWEST = 50
#: Resamples of the confidence intervals, SALib's usual number.
RESAMPLES = 100


class Index(NamedTuple):
    """A first-order index.

    Attributes:
        measure: The measure.
        parameter: The parameter.
        value: The index; 1 explains the whole variance.
        bound: Half of its 95 % confidence interval.
    """

    measure: str
    parameter: str
    value: float
    bound: float


def sensitivity(folder: str | PathLike[str]) -> list[Index]:
    """Compute the sensitivity of each measure to each parameter, over the designs whose status is "ok".

    Args:
        folder: Folder of the results.

    Raises:
        HybridynError: SALib is missing, the folder has no results, or too few designs.
    """
    about = about_of(str(folder))
    names = [*about.parameters, *about.measures]
    parts = []
    for shard in read_shards(str(folder), [*names, "status"]):
        rows = np.column_stack([shard[name] for name in names])
        parts.append(rows[np.array(shard["status"]) == "ok"])
    rows = np.concatenate(parts) if parts else np.empty((0, len(names)))
    x, values = np.split(rows, [len(about.parameters)], axis=1)
    out = []
    for measure, y in zip(about.measures, values.T, strict=True):
        good = np.isfinite(y)
        if good.sum() < FEWEST:
            have = f"{good.sum()} designs with '{measure}'"
            raise HybridynError(f"{folder}: {have} are too few for sensitivity, {FEWEST} are needed")
        found = _analysed(about.parameters, x[good], y[good])
        cells = zip(about.parameters, found["S1"], found["S1_conf"], strict=True)
        out += [Index(measure, name, float(value), float(bound)) for name, value, bound in cells]
    return out


def _analysed(names: list[str], x: Any, y: Any) -> Any:
    """Estimate the indices by SALib; those of a constant measure are 0."""
    if np.ptp(y) == 0:
        return {"S1": [0.0] * len(names), "S1_conf": [0.0] * len(names)}
    try:
        delta: Any = import_module("SALib.analyze.delta")
    except ImportError:
        raise HybridynError(f"sensitivity needs SALib: {install_advice('sensitivity')}") from None
    problem = {"num_vars": len(names), "names": names, "bounds": [[0.0, 1.0]] * len(names)}
    return delta.analyze(problem, x, y, method="sobol", num_resamples=RESAMPLES, seed=0)
