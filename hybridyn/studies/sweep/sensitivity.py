"""Sensitivity of the measures of a sweep to its parameters, by SALib.

The first-order index of a parameter is the part of a measure's variance that this parameter alone explains;
the total index adds what it explains together with others. Designs of the method "saltelli" give both
(Saltelli et al., 2010), those of "morris" the mean size and the spread of elementary effects (Morris, 1991;
Campolongo et al., 2007). Of other designs only the first-order index is estimated, from the means of the
measure in classes of the parameter (Plischke, Borgonovo and Smith, 2013); RBD-FAST would take the regular
order of Sobol points for a dependence. The parameters have to be independent. Designs that could not be
evaluated are left out, and with them their blocks.
"""

from __future__ import annotations

import math
from os import PathLike
from typing import Any, NamedTuple

import numpy as np

from ...errors import HybridynError
from ...spatial import Array
from .best import rows_of
from .salib import LEVELS, block_size, package, problem

#: Fewest designs: with these the indices of a linear function are uncertain by 0.1.
FEWEST = 50
#: Fewest blocks: below, confidence intervals are as wide as the indices.
FEWEST_BLOCKS = {"saltelli": 32, "morris": 4}
#: Resamples of the confidence intervals, SALib's usual number.
RESAMPLES = 100
#: Seed of the resamples, so that indices are the same each time; SALib takes 0 for none.
SEED = 1
#: What an index means, by its kind.
KINDS = {
    "first": "first-order index",
    "total": "total index",
    "mu*": "mean size of effects, mu*",
    "sigma": "spread of effects, sigma",
}


class Index(NamedTuple):
    """An index.

    Attributes:
        value: The index; a first-order index of 1 explains the whole variance. `mu*` and `sigma` have the
            measure's unit, for a change of the parameter over its whole range.
        bound: Half of its 95 % confidence interval, nan for "sigma".
        kind: One of `KINDS`.
    """

    measure: str
    parameter: str
    value: float
    bound: float
    kind: str = "first"


def sensitivity(folder: str | PathLike[str]) -> list[Index]:
    """Compute the sensitivity of each measure to each parameter, over the designs whose status is "ok".

    Raises:
        HybridynError: SALib is missing, the folder has no results, or too few designs.
    """
    about, columns, _, good = rows_of(folder)
    x = np.column_stack([columns[name] for name in about.parameters])
    out = []
    for measure in about.measures:
        y = columns[measure]
        whole, fewest, what, size = good & np.isfinite(y), FEWEST, "designs", 1
        if about.method in FEWEST_BLOCKS:
            fewest, what = FEWEST_BLOCKS[about.method], "whole blocks of designs"
            size = block_size(about.method, len(about.parameters))
            whole = _whole(whole, columns["design"], size)
        have = int(whole.sum()) // size
        if have < fewest:
            raise HybridynError(
                f"{folder}: {have} {what} with '{measure}' are too few for sensitivity, {fewest} are needed"
            )
        for kind, (values, bounds) in _analysed(about.method, x[whole], y[whole]).items():
            cells = zip(about.parameters, values, bounds, strict=True)
            out += [Index(measure, name, float(value), float(bound), kind) for name, value, bound in cells]
    return out


def _whole(good: Any, number: Array, size: int) -> Any:
    """Return which rows are of blocks whose designs are all good, shape (designs,)."""
    block = number.astype(int) // size
    counts = np.bincount(block, weights=good)
    return counts[block] == size


def _analysed(method: str, x: Array, y: Array) -> dict[str, tuple[Any, Any]]:
    """Estimate indices and half confidence intervals by kind; those of a constant measure are 0."""
    count = x.shape[1]
    words: dict[str, Any] = {"num_resamples": RESAMPLES, "seed": SEED}
    if method == "morris":
        found = package("SALib.analyze.morris").analyze(problem(count), x, y, num_levels=LEVELS, **words)
        return {
            "mu*": (found["mu_star"], found["mu_star_conf"]), "sigma": (found["sigma"], [math.nan] * count)
        }  # fmt: skip
    nothing = [0.0] * count
    if np.ptp(y) == 0:
        kinds = ("first", "total") if method == "saltelli" else ("first",)
        return dict.fromkeys(kinds, (nothing, nothing))
    if method == "saltelli":
        sobol = package("SALib.analyze.sobol")
        found = sobol.analyze(problem(count), y, calc_second_order=False, **words)
        return {"first": (found["S1"], found["S1_conf"]), "total": (found["ST"], found["ST_conf"])}
    found = package("SALib.analyze.delta").analyze(problem(count), x, y, method="sobol", **words)
    return {"first": (found["S1"], found["S1_conf"])}
