"""Rates and accelerations of postures that make a value least: the value stays least as time goes on.

With coordinates y of the open motions, the posture at time s after a sample is x(y, s), and the value V(x(y,
s)) is least: V_y = 0. Along a motion that meets the rows, its first derivative by s determines y': V_yy y' +
V_ys = 0. Along one with the right rates, the second one determines y'': V_yy y'' + V_yss = 0.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...spatial import Array
from .bodies import Carried
from .chart import CURVE, SLOPE, STEP, ValueChart
from .problem import ChainProblem


def ahead(problem: ChainProblem, times: Array) -> ChainProblem:
    """Return a problem small times after each sample, shape (T,): known motions go on, to second order."""
    relatives = tuple(
        replace(one, link=one.link.ahead(times), other=one.other.ahead(times), target=one.target.ahead(times))
        for one in problem.relatives
    )
    parts = tuple(
        replace(part, targets=[target.ahead(times) for target in part.targets]) for part in problem.parts
    )
    carried = Carried(tuple(base.ahead(times) for base in problem.carried.bases))
    return replace(problem, parts=parts, carried=carried, relatives=relatives)


def open_rates(chart: ValueChart, hurry: Array, rates: Array, accelerations: Array | None = None) -> Array:
    """Compute what the value adds to rates that meet the rows; with accelerations, to these.

    Args:
        chart: Postures that make the value least.
        hurry: One over the time in which anything moves by one [rad, module lengths], shape (T,).
        rates: Scaled rates that meet the rows, shape (T, nv). With accelerations, they are those of the rule.
        accelerations: Scaled accelerations that meet the rows, shape (T, nv).

    Returns:
        Scaled, shape (T, nv).
    """
    h = STEP / np.where(hurry > 0.0, hurry, 1.0)
    tree, scale = chart.problem.tree, chart.problem.col_scale
    order, stencil = (1, SLOPE) if accelerations is None else (2, CURVE)
    here = chart.gradient(corrections=order)
    mixed = np.zeros_like(here)
    for steps, weight in stencil:
        for sign in (1.0, -1.0):
            s = sign * steps * h
            way = s[:, None] * rates * scale
            if accelerations is not None:
                way += 0.5 * s[:, None] ** 2 * (accelerations * scale + tree.bending(rates * scale))
            q = tree.integrate(chart.q, way)
            there = replace(chart, problem=ahead(chart.problem, s), q=q)
            change = there.gradient(corrections=order)
            mixed += (sign**order * weight / h**order)[:, None] * (change - here)
    return chart.spread(np.asarray(np.linalg.solve(chart.curvature, -mixed[:, :, None]))[:, :, 0])
