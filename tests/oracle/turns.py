"""Whole turns of continuous joints in couplings."""

from __future__ import annotations

from typing import Any

import numpy as np

#: Whole turns of a continuous joint that a coupling may have made, for two such joints; fewer for more.
MOST_TURNS = 60
#: Combinations of turns that are tried.
COMBINATIONS = 4000
#: Residuals that differ by less than this for each turn count as equal: the fewest turns are taken [rad].
SAME_RESIDUAL = 1e-12


def nearest_turns(value: float, turns: list[Any]) -> Any:
    """Return the sum of whole turns that is nearest to a coupling's value.

    The angle of a continuous joint is determined up to whole turns. All joints but the last are turned by
    every number in a range, the last by the number that brings the sum nearest.

    Args:
        value: The coupling's value for angles within half a turn.
        turns: Change of the value by one turn of each continuous joint.
    """
    if not turns:
        return 0.0
    others, last = turns[:-1], float(turns[-1])
    most = min(MOST_TURNS, int(COMBINATIONS ** (1 / len(others)) / 2)) if others else 0
    ranges = [np.arange(-most, most + 1)] * len(others)
    counts = np.array(np.meshgrid(*ranges)).reshape(len(others), (2 * most + 1) ** len(others))
    left = value - np.array([float(x) for x in others]) @ counts
    final = np.round(left / last)
    best = int(np.argmin(np.abs(left - final * last) + SAME_RESIDUAL * np.abs(counts).sum(axis=0)))
    return sum(x * int(n) for x, n in zip(others, counts[:, best], strict=True)) + turns[-1] * int(
        final[best]
    )
