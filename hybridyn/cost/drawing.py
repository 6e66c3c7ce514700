"""The work-precision figure: error against time, one line per family; lower left is better."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .points import Study, front

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = ("#0b6e99", "#c8553d", "#3f8f5f", "#7a5195", "#d99a1c", "#555f6b", "#1c9ba6", "#a63d6f")


def figure_of(study: Study, title: str) -> Figure:
    """Draw a study."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 5.6), layout="constrained")
    ax = figure.add_subplot()
    scale = 1e6 if study.time_unit == "per sample" else 1.0
    lines: dict[str, list[tuple[float, float]]] = {}
    for point in study.points:
        if not point.failure and point.seconds > 0:
            lines.setdefault(point.line, []).append((point.seconds * scale, max(point.error, 1e-17)))
    for (name, places), colour in zip(lines.items(), COLOURS * 3, strict=False):
        x, y = zip(*sorted(places), strict=True)
        ax.plot(x, y, "o", color=colour, ms=5, label=name, ls="-" if study.time_unit == "per run" else "none")
    best = [(p.seconds * scale, max(p.error, 1e-17)) for p in front(study.points)]
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
        xlabel=f"time {study.time_unit} [{'us' if scale > 1 else 's'}]",
        ylabel="relative error",
        title=title,
    )
    ax.grid(color="#eeeeee")
    ax.spines[["top", "right"]].set_visible(False)
    ax.legend(frameon=False, fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure
