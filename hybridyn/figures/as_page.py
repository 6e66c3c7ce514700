"""Write a chart as an interactive HTML page (plotly) that needs no network."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..colours import ALARM, MODULES
from ..errors import HybridynError, install_advice
from .panels import Chart, Panel

if TYPE_CHECKING:
    from plotly.graph_objects import Figure

HEIGHT, MARGIN = 250, 120  # of a panel, around all of them [pixels]
#: Largest number of columns: a page is narrower than a figure.
MOST_COLUMNS = 3
#: How marks are drawn.
STYLES: dict[str, dict[str, Any]] = {
    "dots": {"size": 3, "opacity": 0.6},
    "peak": {"size": 9, "symbol": "triangle-up"},
    "solid": {"width": 1.4},
    "dashed": {"width": 1.2, "dash": "dash"},
}


def page_of_chart(chart: Chart) -> str:
    """Return a chart as the text of a self-contained HTML file.

    Raises:
        HybridynError: plotly is missing.
    """
    text: str = _figure(chart).to_html(include_plotlyjs=True, full_html=True)
    return text


def _figure(chart: Chart) -> Figure:
    try:
        from plotly.subplots import make_subplots
    except ImportError as error:
        message = f"pages need plotly: {install_advice('plot')}"
        raise HybridynError(message) from error
    columns = min(chart.columns, MOST_COLUMNS)
    rows = max(-(-len(chart.panels) // columns), 1)
    figure = make_subplots(
        rows,
        columns,
        vertical_spacing=0.28 / max(rows, 2),
        shared_xaxes="all" if chart.over_time else False,
        subplot_titles=[_title(panel) for panel in chart.panels],
    )
    named: set[str] = set()
    for number, panel in enumerate(chart.panels):
        place = {"row": number // columns + 1, "col": number % columns + 1}
        _add_panel(figure, chart, panel, place)
        _add_marks(figure, panel, place, named)
        if number + columns >= len(chart.panels) and chart.over_time:
            figure.update_xaxes(title_text=chart.x_label, showticklabels=True, **place)
    figure.update_layout(
        title=chart.title,
        height=(1.3 if chart.across else 1.0) * HEIGHT * rows + MARGIN,
        template="plotly_white",
        hovermode="x unified" if chart.over_time else "closest",
        barmode="group",
        legend={"groupclick": "toggleitem", "tracegroupgap": 4, "font": {"size": 11}},
    )
    return figure


def _add_marks(figure: Figure, panel: Panel, place: dict[str, int], named: set[str]) -> None:
    """Draw points and lines; a name in the legend shows and hides its marks in all panels."""
    import plotly.graph_objects as go

    for mark in panel.marks:
        dots = mark.style in ("dots", "peak")
        style = {"color": mark.colour, **STYLES[mark.style]}
        trace = go.Scatter(
            x=mark.x.tolist(), y=mark.y.tolist(), name=mark.name, legendgroup=mark.name,
            showlegend=mark.name not in named, mode="markers" if dots else "lines",
            **{"marker" if dots else "line": style},
        )  # fmt: skip
        figure.add_trace(trace, **place)
        named.add(mark.name)
    if panel.marks:
        figure.update_xaxes(title_text=panel.x_label, **place)


def _title(panel: Panel) -> str:
    far = panel.far_limits()
    colour = panel.colour or "#222222"
    return f'<b style="color:{colour}">{panel.title}</b>' + (f" ({far})" if far else "")


def _add_panel(figure: Figure, chart: Chart, panel: Panel, place: dict[str, int]) -> None:
    import plotly.graph_objects as go

    group = {"legendgroup": panel.title, "legendgrouptitle_text": panel.title}
    for number, line in enumerate(panel.lines):
        colour = MODULES[number % len(MODULES)]
        if panel.ticks:
            bar = go.Bar(
                x=panel.ticks, y=line.y, error_y={"array": line.bound}, name=line.name, marker_color=colour,
                **group,
            )  # fmt: skip
            figure.add_trace(bar, **place)
            continue
        trace: Any = go.Scatter(
            x=chart.x, y=line.y, name=line.name, mode="lines", line={"color": colour, "width": 1.6}, **group
        )
        figure.add_trace(trace, **place)
        if line.mark_peak and line.y.any():
            text = f"peak of {line.name}: {line.y[line.peak]:.6g} {panel.unit}"
            peak = go.Scatter(
                x=[chart.x[line.peak]],
                y=[line.y[line.peak]],
                mode="markers",
                marker={"color": colour, "size": 7},
                hovertemplate=f"{text}<extra></extra>",
                showlegend=False,
                legendgroup=panel.title,
            )
            figure.add_trace(peak, **place)
    for limit, owner in panel.limits():
        colour = ALARM if owner is None else MODULES[owner % len(MODULES)]
        for sign in (-1.0, 1.0):
            figure.add_hline(y=sign * limit, line={"color": colour, "dash": "dash", "width": 1}, **place)
    scale = {"type": "log", "exponentformat": "power"} if panel.logarithmic else {}
    figure.update_yaxes(title_text=panel.label, **scale, **place)
