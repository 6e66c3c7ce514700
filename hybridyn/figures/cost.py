"""Work-precision diagram: error against computing time, one colour per family; lower left is better."""

from __future__ import annotations

from itertools import cycle
from math import inf

import numpy as np

from ..colours import GOOD, MODULES, MOTOR
from ..studies.cost.points import ADVISED, CostStudy, by_line, cheapest, front
from .panels import Mark, Panel, PanelFigure

REMARK = "Lower left is better. Pale: all settings; line: the front."
CALLS = " Filled: one call; open: a batch."
#: What no error is drawn below.
LEAST = 1e-17
#: Size of a panel [inch].
SIZE = (4.6, 3.6)


def chart_of_cost(study: CostStudy, source: str) -> PanelFigure:
    """Build the fronts of a study, and beside them what effects change against what they take."""
    each = study.time_unit == "per sample"
    unit, scale = ("us", 1e6) if each else ("s", 1.0)
    drawn = by_line([p for p in study.points if 0 < p.seconds < inf > p.error])
    usual = next((p for p in study.points if p.use == "usual"), None)
    chosen = (("now", usual, MOTOR), ("advised", cheapest(study, ADVISED), GOOD))
    lines = [(words, [p], "ring", colour) for words, p, colour in chosen if p and p.error < inf]
    for (name, own), colour in zip(drawn.items(), cycle(MODULES), strict=False):
        style = "open" if each and not own[0].one_call else "front"
        lines += [("", own, "pale", colour), (name, front(own, study.own_error) or own, style, colour)]
    marks = []
    for name, points, style, colour in lines:
        x, y = np.array([(p.seconds * scale, max(p.error, LEAST)) for p in points]).T
        marks.append(Mark(name, x, y, style, colour))
    panels = [
        Panel(study.subject, "relative error", marks, f"time {study.time_unit} [{unit}]", logarithmic="xy")
    ]
    if study.worth:
        order = sorted(study.worth, key=lambda one: one.error)
        names = [one.effect.replace("_", " ") + ("" if one.computed else " (left out)") for one in order]
        shares = {
            "change without it": [one.error for one in order],
            "part of time": [one.share for one in order],
        }
        bars = [
            Mark(name, names, np.clip(values, study.own_error, 1e3), "bar", colour)
            for (name, values), colour in zip(shares.items(), (MOTOR, "#b9b9b9"), strict=True)
        ]
        panels.append(Panel("effects", "part of the whole", bars, logarithmic="y"))
    return PanelFigure(
        f"{source}: {study.question}\n{REMARK}{CALLS * each}", panels, across=len(panels), size=SIZE
    )
