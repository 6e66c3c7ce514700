"""Write a chart as an interactive HTML page (plotly) that needs no network."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..colours import ALARM, MODULES
from ..errors import HybridynError, install_advice
from .panels import Chart, Panel

if TYPE_CHECKING:
    from plotly.graph_objects import Figure

HEIGHT, MARGIN = 250, 120  # of a panel, around all of them [pixels]


def page_of_chart(chart: Chart) -> str:
    """Return a chart as the text of a self-contained HTML file.

    Raises:
        HybridynError: plotly is missing.
    """
    return page_of_figure(_figure(chart))


def page_of_figure(figure: Figure) -> str:
    """Return a plotly figure as the text of a self-contained HTML file."""
    text: str = figure.to_html(include_plotlyjs=True, full_html=True)
    return text


def subplots(rows: int, columns: int, **options: Any) -> Figure:
    """Return a plotly figure of empty panels.

    Raises:
        HybridynError: plotly is missing.
    """
    try:
        from plotly.subplots import make_subplots
    except ImportError as error:
        message = f"pages need plotly: {install_advice('plot')}"
        raise HybridynError(message) from error
    return make_subplots(rows, columns, vertical_spacing=0.28 / max(rows, 2), **options)


def _figure(chart: Chart) -> Figure:
    columns = chart.columns
    rows = -(-len(chart.panels) // columns)
    bars = any(panel.ticks for panel in chart.panels)
    figure = subplots(
        rows,
        columns,
        shared_xaxes=False if bars else "all",
        subplot_titles=[_title(panel) for panel in chart.panels],
    )
    for number, panel in enumerate(chart.panels):
        place = {"row": number // columns + 1, "col": number % columns + 1}
        _add_panel(figure, chart, panel, place)
        if number + columns >= len(chart.panels) and not bars:
            figure.update_xaxes(title_text=chart.x_label, showticklabels=True, **place)
    figure.update_layout(
        title=chart.title,
        height=HEIGHT * rows + MARGIN,
        template="plotly_white",
        hovermode="closest" if bars else "x unified",
        barmode="group",
        legend={"groupclick": "toggleitem", "tracegroupgap": 4, "font": {"size": 11}},
    )
    return figure


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
            bar = go.Bar(x=panel.ticks, y=line.y, name=line.name, marker_color=colour, **group)
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
