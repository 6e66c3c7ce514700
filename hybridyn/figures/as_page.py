"""Write a chart as an interactive HTML page (plotly) that needs no network."""

from __future__ import annotations

from typing import Any

from ..errors import required
from .panels import Mark, PanelFigure

HEIGHT, MARGIN = 250, 120  # of a panel, around all of them [pixels]
#: How marks are drawn.
STYLES: dict[str, dict[str, Any]] = {
    "solid": {"mode": "lines", "line_width": 1.6},
    "dashed": {"mode": "lines", "line_width": 1.2, "line_dash": "dash"},
    "dots": {"mode": "markers", "marker_size": 3, "opacity": 0.6},
    "dot": {"mode": "markers", "marker_size": 7},
    "ring": {"mode": "markers", "marker_size": 13, "marker_symbol": "circle-open"},
    "pale": {"mode": "markers", "marker_size": 5, "opacity": 0.16},
    "front": {"mode": "lines+markers", "marker_size": 6},
    "open": {"mode": "lines+markers", "marker_size": 6, "marker_symbol": "circle-open"},
}


def page_of_chart(chart: PanelFigure) -> str:
    """Return a chart as the text of a self-contained HTML file.

    Raises:
        HybridynError: plotly is missing.
    """
    subplots = required("plotly.subplots", "plot", "a page")
    columns, rows, shared = chart.columns, chart.rows, bool(chart.x_label)
    titles = [f'<b style="color:{panel.colour}">{panel.title}</b>' for panel in chart.panels]
    figure = subplots.make_subplots(
        rows, columns, vertical_spacing=0.28 / max(rows, 2), shared_xaxes="all" if shared else False,
        subplot_titles=titles,
    )  # fmt: skip
    named = {""}
    for number, panel in enumerate(chart.panels):
        place = {"row": number // columns + 1, "col": number % columns + 1}
        for mark in panel.marks:
            words = {"legendgroup": mark.name, "showlegend": mark.name not in named}
            if shared:
                title = dict.fromkeys(("legendgroup", "legendgrouptitle_text"), panel.title)
                words = title | {"showlegend": bool(mark.name)}
            figure.add_trace(_trace(mark) | words, **place)
            named.add(mark.name)
        bottom = shared and number + columns >= len(chart.panels)
        figure.update_xaxes(
            title_text=chart.x_label if bottom else panel.x_label,
            showticklabels=bottom or not shared,
            **place,
        )
        figure.update_yaxes(title_text=panel.label, **place)
        for axis in panel.logarithmic:
            getattr(figure, f"update_{axis}axes")(type="log", exponentformat="power", **place)
    figure.update_layout(
        title=chart.title.replace("\n", "<br>"),
        height=(1.0 if shared else 1.3) * HEIGHT * rows + MARGIN, barmode="group",
        template="plotly_white", hovermode="x unified" if shared else "closest",
        legend={"groupclick": "toggleitem", "tracegroupgap": 4, "font": {"size": 11}},
    )  # fmt: skip
    text: str = figure.to_html(include_plotlyjs=True, full_html=True)
    return text


def _trace(mark: Mark) -> dict[str, Any]:
    """Return a mark as plotly draws it."""
    common = {"x": list(mark.x), "y": list(mark.y), "name": mark.name}
    if mark.style == "bar":
        return common | {"type": "bar", "marker_color": mark.colour}
    own = {f"{part}_color": mark.colour for part in ("line", "marker")}
    return common | {"type": "scatter"} | STYLES[mark.style] | own
