"""Speed-effort cloud of every motor as an interactive HTML page (plotly) that needs no network."""

from __future__ import annotations

import math
from typing import Any

from ..colours import ALARM, GOOD, MODULES, MOTOR
from ..studies.sizing import Sizing
from .as_page import HEIGHT, MARGIN, page_of_figure, subplots
from .sizing import Cloud, clouds

#: Columns of panels: a page is narrower than a figure.
COLUMNS = 3


def page_of_sizing(sizing: Sizing, *, title: str = "") -> str:
    """Return the clouds of all motors as the text of a self-contained HTML file.

    A name in the legend shows and hides its marks in all panels.

    Raises:
        HybridynError: plotly is missing.
    """
    shown = clouds(sizing)
    columns = min(COLUMNS, max(len(shown), 1))
    rows = max(math.ceil(len(shown) / columns), 1)
    figure = subplots(rows, columns, subplot_titles=[cloud.motor for cloud in shown])
    import plotly.graph_objects as go

    named: set[str] = set()
    for number, cloud in enumerate(shown):
        place = {"row": number // columns + 1, "col": number % columns + 1}
        for name, x, y, style in _marks(cloud):
            trace = go.Scatter(x=x, y=y, name=name, legendgroup=name, showlegend=name not in named, **style)
            figure.add_trace(trace, **place)
            named.add(name)
        figure.update_xaxes(title_text=f"speed [{cloud.units[0]}]", **place)
        figure.update_yaxes(title_text=f"effort [{cloud.units[1]}]", **place)
    figure.update_layout(title=title, height=1.3 * HEIGHT * rows + MARGIN, template="plotly_white")
    return page_of_figure(figure)


def _marks(cloud: Cloud) -> list[tuple[str, list[float], list[float], dict[str, Any]]]:
    """Return the marks of a motor: name, speeds, efforts and style; lines cross the whole panel."""
    speeds, efforts = cloud.points.T.tolist() if len(cloud.points) else ([], [])
    dots: dict[str, Any] = {"mode": "markers", "marker": {"color": MODULES[0], "size": 3, "opacity": 0.6}}
    marks = [("samples", speeds, efforts, dots)]
    if cloud.peak:
        peak = {"mode": "markers", "marker": {"color": MOTOR, "size": 9, "symbol": "triangle-up"}}
        marks.append(("peak effort", [cloud.peak[0]], [cloud.peak[1]], peak))
    drawn = [limit for limit in (cloud.speed_limit,) if limit < math.inf]
    right = max([abs(speed) for speed in speeds] + drawn, default=1.0)
    drawn = [limit for limit in (cloud.effort_limit,) if limit < math.inf]
    top = max([abs(effort) for effort in efforts] + drawn, default=1.0)
    mean = {"mode": "lines", "line": {"color": GOOD, "width": 1.2, "dash": "dash"}}
    limit = {"mode": "lines", "line": {"color": ALARM, "width": 1.4}}
    for sign in (-1.0, 1.0):
        marks.append(("RMS effort", [-right, right], [sign * cloud.rms] * 2, mean))
        if cloud.effort_limit < math.inf:
            marks.append(("limit", [-right, right], [sign * cloud.effort_limit] * 2, limit))
        if cloud.speed_limit < math.inf:
            marks.append(("limit", [sign * cloud.speed_limit] * 2, [-top, top], limit))
    return marks
