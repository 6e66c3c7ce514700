"""How fast searches and solvers descend: their tables and panels in the report."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from benchmarks.fronts import chosen, grouped
from benchmarks.panels import Curve, Panel
from benchmarks.results import Row
from benchmarks.texts import number

Results = dict[str, list[Row]]
COLOURS = {
    "SLSQP": "#0b4f9e", "CMA-ES": "#e07b00",
    "exact": "#0b4f9e", "Gauss-Newton": "#00a5ab", "Crocoddyl FDDP": "#e07b00",
}  # fmt: skip
NAMES = {"SLSQP": "SLSQP, with gradients", "exact": "DDP, exact", "Gauss-Newton": "DDP, Gauss-Newton"}
#: Least excess and least error that figures show: beyond, an energy and efforts are known well enough.
LEAST, SMALLEST = 1e-6, 1e-12


def searched(results: Results) -> tuple[Sequence[str], list[list[str]]]:
    """Give by how much searches miss the least objective after some work: median and worst of the starts."""
    rows = results["searches"]
    if not rows:
        return [], []
    best, lines = min(row.value for row in rows), []
    for (method, work), own in grouped(rows, "method", "at").items():
        over = [100 * (row.value / best - 1) for row in own]
        said = [f"{number(x)} %" for x in (min(over), float(np.median(over)), max(over))]
        lines.append([NAMES.get(method, method), f"{work:.0f}", *said])
    for method, own in grouped(rows, "method").items():
        each = {row.setting: row.seconds for row in own}
        spent = f"{1e3 * np.mean([*each.values()]):.0f} ms a design"
        lines.append([NAMES.get(method, method), spent, "", "", ""])
    head = ["method", "work [designs]", f"above {best:.4f} J: best start", "median", f"worst of {len(each)}"]
    return head, lines


def searches(results: Results) -> list[list[Panel]]:
    """Draw by how much searches miss the least objective against their work."""
    rows = results["searches"]
    best = min((row.value for row in rows), default=0.0)
    curves = []
    for method, own in grouped(rows, "method").items():
        over = [row._replace(error=max(row.value / best - 1, LEAST)) for row in own]
        middle = {at: float(np.median([r.error for r in some])) for at, some in grouped(over, "at").items()}
        pale = [row.at for row in over], [row.error for row in over]
        name, drawn = NAMES.get(method, method), ([*middle], [*middle.values()])
        curves.append(Curve(name, COLOURS[method], *drawn, all_x=pale[0], all_y=pale[1]))
    y = f"energy above the least (from {LEAST:.0e} on)"
    return [[Panel("five-bar leg with its gears' mass", "work, in designs without gradients", y, curves)]]


def iterated(results: Results) -> tuple[Sequence[str], list[list[str]]]:
    """Give iterations and time of DDP: median and largest of the starts."""
    lines = []
    for (motion, method), own in grouped(chosen(results["shooting"], note=""), "model", "method").items():
        runs = [row for row in own if row.setting != "path"]
        needed = [row.iterations for row in runs]
        counts = [f"{x:.0f}" if math.isfinite(x) else "not reached" for x in (np.median(needed), max(needed))]
        time = f"{1e3 * float(np.median([row.seconds for row in runs])):.0f}"
        lines.append([motion, NAMES.get(method, method), *counts, time])
    return ["motion", "solver", "iterations: median", "largest", "time until it ends [ms]"], lines


def shooting(results: Results) -> list[list[Panel]]:
    """Draw the error of the efforts against iterations."""
    y, out = f"error of the efforts, over their size (from {SMALLEST:.0e} on)", []
    for motion, own in grouped(chosen(results["shooting"], setting="path"), "model").items():
        curves = []
        for method, of in grouped(own, "method").items():
            errors = [max(row.error, SMALLEST) for row in of]
            curves.append(Curve(NAMES.get(method, method), COLOURS[method], [row.at for row in of], errors))
        out.append(Panel(motion, "iteration", y, curves, counted=True))
    return [out]
