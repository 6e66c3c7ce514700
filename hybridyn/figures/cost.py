"""Work-precision diagram: error against computing time, one colour per family; lower left is better."""

from __future__ import annotations

from itertools import cycle
from math import inf
from typing import TYPE_CHECKING

from ..studies.cost.points import ADVISED, Study, by_line, cheapest, front
from .fronts import Bars, Curve, Panel, draw

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = ("#0b4f9e", "#e07b00", "#3f8f4f", "#7a3fa0", "#00a5ab", "#c22f1f", "#8a8a8a", "#9c5400")
REMARK = "Lower left is better. Pale: all settings; line: the front."
CALLS = " Filled: one call; open: a batch."


def figure_of(study: Study, source: str) -> Figure:
    """Draw the fronts of a study, and beside them what effects change against what they take."""
    each = study.time_unit == "per sample"
    unit, scale = ("us", 1e6) if each else ("s", 1.0)
    curves = []
    drawn = by_line([p for p in study.points if 0 < p.seconds < inf > p.error])
    for (name, own), colour in zip(drawn.items(), cycle(COLOURS), strict=False):
        (x, y), (all_x, all_y) = (
            zip(*((p.seconds * scale, p.error) for p in points), strict=True)
            for points in (front(own, study.own_error) or own, own)
        )
        hollow = [each and not own[0].one_call] * len(x)
        curves.append(Curve(name, colour, x, y, hollow=hollow, all_x=all_x, all_y=all_y))
    named = (
        (next((p for p in study.points if p.use == "usual"), None), "now"),
        (cheapest(study, ADVISED), "advised"),
    )
    notes = [(p.seconds * scale, p.error, words) for p, words in named if p]
    panels: list[Panel | Bars] = [
        Panel(study.subject, f"time {study.time_unit} [{unit}]", "relative error", curves, notes=notes)
    ]
    if study.worth:
        order = sorted(study.worth, key=lambda one: one.error)
        names = [one.effect.replace("_", " ") + ("" if one.computed else " (left out)") for one in order]
        pairs = {
            "change without it": [one.error for one in order],
            "part of time": [one.share for one in order],
        }
        panels.append(Bars("effects", "part of the whole", names, pairs, study.own_error))
    return draw(f"{source}: {study.question}", REMARK + CALLS * each, [panels])
