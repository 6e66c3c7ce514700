"""Work-precision diagram: error against computing time, one colour per family; lower left is better."""

from __future__ import annotations

from itertools import cycle
from typing import TYPE_CHECKING

from ..studies.cost.points import ADVISED, Study, cheapest, front, fronts
from .blank import empty_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = ("#0b6e99", "#c8553d", "#3f8f5f", "#7a5195", "#d99a1c", "#555f6b", "#1c9ba6", "#a63d6f")

#: Value drawn for an error of zero, since the axis is logarithmic.
LEAST = 1e-17


def figure_of(study: Study, source: str) -> Figure:
    """Draw the work-precision diagram of a study, and beside it what effects are worth."""
    figure = empty_figure(12 if study.worth else 9, 5.6)
    widths = (3, 1) if study.worth else (3,)
    first, *second = figure.subplots(1, len(widths), squeeze=False, width_ratios=widths)[0]
    _draw_settings(first, study)
    first.set_title(f"{source}: {study.question}", fontsize=10)
    for ax in second:
        _draw_effects(ax, study)
    for ax in figure.axes:
        ax.spines[["top", "right"]].set_visible(False)
    return figure


def _draw_settings(ax: Axes, study: Study) -> None:
    """Draw the settings, the fronts, and the names of the present and of the advised setting."""
    unit, scale = ("µs", 1e6) if study.time_unit == "per sample" else ("s", 1.0)
    drawn = [p for p in study.points if not p.failure and p.seconds > 0]
    families = list(dict.fromkeys(p.line for p in drawn))
    for name, colour in zip(families, cycle(COLOURS), strict=False):
        own = [p for p in drawn if p.line == name]
        filled = colour if any(p.one_call for p in own) else "none"
        x, y = [p.seconds * scale for p in own], [max(p.error, LEAST) for p in own]
        ax.plot(x, y, "o", color=colour, mfc=filled, ms=4, alpha=0.3)
        best = front(own, study.own_error) or own
        x, y = [p.seconds * scale for p in best], [max(p.error, LEAST) for p in best]
        ax.plot(x, y, "-o", color=colour, mfc=filled, ms=6, label=name)
    worth = [(p.seconds * scale, max(p.error, LEAST)) for p in fronts(study)[0]]
    if worth:
        ax.step(*zip(*worth, strict=True), where="post", color="#888888", lw=1, ls=":", label="worth having")
    if study.own_error > 0:
        ax.axhline(study.own_error, color="#bbbbbb", lw=1, label="error of the reference")
    usual = next((p for p in drawn if p.use == "usual"), None)
    for point, words in ((usual, "now"), (cheapest(study, ADVISED), "advised")):
        if point is not None:
            place = point.seconds * scale, max(point.error, LEAST)
            ax.annotate(words, place, (8, 8), textcoords="offset points", fontsize=9, weight="bold")
    ax.set(xscale="log", yscale="log", xlabel=f"time {study.time_unit} [{unit}]", ylabel="relative error")
    ax.grid(color="#eeeeee")
    ax.legend(frameon=False, fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))


def _draw_effects(ax: Axes, study: Study) -> None:
    """Draw a bar for what each effect changes, labelled with what it takes."""
    order = sorted((one for one in study.worth if one.error > 0), key=lambda one: one.error)
    names = [one.effect.replace("_", " ") + ("" if one.computed else " (not computed)") for one in order]
    bars = ax.barh(names, [one.error for one in order], color="#0b6e99")
    for bar, one in zip(bars, order, strict=True):
        bar.set_alpha(1.0 if one.computed else 0.4)
    ax.bar_label(bars, [f" {100 * one.share:.2g} %" for one in order], fontsize=8)
    ax.set(xscale="log", xlabel="change; label: time", title="effects")
    ax.axvline(ADVISED, color="#bbbbbb", lw=1)
    ax.margins(x=0.3)
