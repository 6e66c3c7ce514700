"""Write a chart as an interactive HTML page (plotly) that needs no network."""

from __future__ import annotations

from typing import Any

from ..errors import HybridynError, install_advice
from .panels import Chart, Mark

HEIGHT, MARGIN = 250, 120  # of a panel, around all of them [pixels]
#: How marks are drawn.
STYLES: dict[str, dict[str, Any]] = {
    "solid": {"mode": "lines", "line_width": 1.6},
    "dashed": {"mode": "lines", "line_width": 1.2, "line_dash": "dash"},
    "dots": {"mode": "markers", "marker_size": 3, "opacity": 0.6},
    "dot": {"mode": "markers", "marker_size": 7},
}


def page_of_chart(chart: Chart) -> str:
    """Return a chart as the text of a self-contained HTML file.

    Raises:
        HybridynError: plotly is missing.
    """
    try:
        from plotly.subplots import make_subplots
    except ImportError as error:
        message = f"pages need plotly: {install_advice('plot')}"
        raise HybridynError(message) from error
    columns, rows, shared = chart.columns, chart.rows, bool(chart.x_label)
    titles = [f'<b style="color:{panel.colour}">{panel.title}</b>' for panel in chart.panels]
    figure = make_subplots(
        rows, columns, vertical_spacing=0.28 / max(rows, 2), shared_xaxes="all" if shared else False,
        subplot_titles=titles,
    )  # fmt: skip
    named: set[str] = set()
    for number, panel in enumerate(chart.panels):
        place = {"row": number // columns + 1, "col": number % columns + 1}
        group = {"legendgroup": panel.title, "legendgrouptitle_text": panel.title} if shared else {}
        for mark in panel.marks:
            seen = not mark.name or (not shared and mark.name in named)
            words = group or {"legendgroup": mark.name}  # a name shows and hides its marks in all panels
            figure.add_trace(_trace(mark).update(showlegend=not seen, **words), **place)
            named.add(mark.name)
        bottom = shared and number + columns >= len(chart.panels)
        figure.update_xaxes(title_text=chart.x_label if bottom else panel.x_label, **place)
        if bottom:
            figure.update_xaxes(showticklabels=True, **place)
        scale = {"type": "log", "exponentformat": "power"} if panel.logarithmic else {}
        figure.update_yaxes(title_text=panel.label, **scale, **place)
    figure.update_layout(
        title=chart.title, height=(1.0 if shared else 1.3) * HEIGHT * rows + MARGIN, barmode="group",
        template="plotly_white", hovermode="x unified" if shared else "closest",
        legend={"groupclick": "toggleitem", "tracegroupgap": 4, "font": {"size": 11}},
    )  # fmt: skip
    text: str = figure.to_html(include_plotlyjs=True, full_html=True)
    return text


def _trace(mark: Mark) -> Any:
    """Return a mark as plotly draws it."""
    import plotly.graph_objects as go

    if mark.style == "bar":
        return go.Bar(x=list(mark.x), y=list(mark.y), name=mark.name, marker_color=mark.colour)
    style = STYLES[mark.style]
    colour = {"line_color" if style["mode"] == "lines" else "marker_color": mark.colour}
    return go.Scatter(x=list(mark.x), y=list(mark.y), name=mark.name, **style, **colour)
