"""Chart of a sweep: every measure over every parameter."""

from __future__ import annotations

from os import PathLike

import numpy as np

from ..colours import ALARM, MODULES
from ..studies.sweep.best import rows_of
from .panels import Mark, Panel, PanelFigure

#: Colour of designs that do not meet a condition.
PALE = "#bfbfbf"
#: Largest number of points per panel; of more designs, evenly spaced ones are drawn.
MOST_POINTS = 20_000
#: Largest number of rows, and of columns, of panels; the title says what is left out.
MOST_PANELS = 24


def chart_of_sweep(folder: str | PathLike[str], where: str | None = None) -> PanelFigure:
    """Build a chart of a sweep: a row of panels per measure, a column per parameter.

    Designs that could not be evaluated are red marks at the bottom; those that do not meet `where` are grey.

    Raises:
        HybridynError: The folder has no results, or the condition is wrong.
    """
    about, columns, status, met = rows_of(folder, where)
    good = status == "ok"
    some = columns["design"] % -(-about.designs // MOST_POINTS) == 0  # evenly spaced
    parameters, measures = about.parameters[:MOST_PANELS], about.measures[:MOST_PANELS]
    panels = []
    for measure in measures:
        low = columns[measure][good].min() if good.any() else 0.0
        y = np.where(good, columns[measure], low)
        for name in parameters:
            marks = [
                Mark(what, columns[name][of], y[of], "dots", colour)
                for what, of, colour in (
                    ("does not meet the condition", some & good & ~met, PALE),
                    ("designs", some & met, MODULES[0]), ("not evaluated", some & ~good, ALARM),
                )
                if of.any()
            ]  # fmt: skip
            panels.append(Panel("", about.label(measure), marks, name))
    title = f"{about.study}: {some.sum():,} of {about.designs:,} designs"
    for what, drawn, there in (
        ("measures", measures, about.measures), ("parameters", parameters, about.parameters),
    ):  # fmt: skip
        if len(drawn) < len(there):
            title += f", the first {len(drawn)} of {len(there)} {what}"
    return PanelFigure(title, panels, across=len(parameters))
