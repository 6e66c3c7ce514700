"""Work-precision diagram: error against computing time, one line per family; lower left is better."""

from __future__ import annotations

from itertools import cycle, product
from typing import TYPE_CHECKING

from ..studies.cost.points import Study, front

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = ("#0b6e99", "#c8553d", "#3f8f5f", "#7a5195", "#d99a1c", "#555f6b", "#1c9ba6", "#a63d6f")

#: Value drawn for an error of zero, since the axis is logarithmic.
LEAST = 1e-17

#: Families whose settings are not ordered from coarse to fine. Their points are not joined by a line.
UNORDERED = ("effects", "C in float64", "C in float32", "rates of the trajectory", "as the scene says")


def figure_of(study: Study, source: str) -> Figure:
    """Draw the work-precision diagram of a study."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 5.6), layout="constrained")
    ax = figure.add_subplot()
    scale = 1e6 if study.time_unit == "per sample" else 1.0
    lines: dict[str, list[tuple[float, float]]] = {}
    for point in study.points:
        if not point.failure and point.seconds > 0:
            name = point.line + " (comparison)" * (point.use == "comparison")
            lines.setdefault(name, []).append((point.seconds * scale, max(point.error, LEAST)))
    for (name, places), (marker, colour) in zip(lines.items(), cycle(product("osv", COLOURS)), strict=False):
        x, y = zip(*sorted(places), strict=True)
        style = "none" if name in UNORDERED else "--" if "comparison" in name else "-"
        ax.plot(x, y, marker, color=colour, ms=5, label=name, ls=style)
    best = [(p.seconds * scale, max(p.error, LEAST)) for p in front(study.points, study.own_error)]
    if best:
        ax.step(*zip(*best, strict=True), where="post", color="#888888", lw=1, ls=":", label="worth having")
    if study.own_error > 0:
        ax.axhline(study.own_error, color="#bbbbbb", lw=1)
        ax.annotate(
            "error of the reference",
            (1, study.own_error),
            xycoords=("axes fraction", "data"),
            ha="right",
            va="bottom",
            color="#777777",
            fontsize=8,
        )
    ax.set(
        xscale="log",
        yscale="log",
        xlabel=f"time {study.time_unit} [{'µs' if scale > 1 else 's'}]",
        ylabel="relative error",
        title=f"{source}: {study.question}",
    )
    ax.grid(color="#eeeeee")
    ax.spines[["top", "right"]].set_visible(False)
    ax.legend(frameon=False, fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure
