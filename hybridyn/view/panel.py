"""What the page's panel says, as HTML: status, distances from singularities, efforts and legend."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape

import numpy as np

from ..colours import ALARM, CLOSURE, GOOD, JOINT, MOTOR, WARNING, module_colour
from ..dynamics.inverse import idm
from ..errors import HybridynError
from ..simulation.events import near_singularity
from ..spatial import Array
from ..structure.robot import HybridRobot

SMALL = "font-size:0.8em;line-height:1.35;padding:0 0.9em"
#: Closeness below which a posture is reported as near a singularity, and as singular.
NEAR_SINGULAR, AT_SINGULAR = 1e-2, 1e-3
#: Number of decades that the bar of a distance spans.
DECADES = 4
TRACK = "#e9ecef"


def closeness(robot: HybridRobot, q: Array) -> dict[str, float]:
    """Compute the distances of a posture, shape (nq,), from singularities of "closures" and "motors".

    They are the values of `near_singularity`: 0 where rank or a motion is lost, and 1 if there are none.
    """
    still = np.zeros(robot.nv)
    events = {what: near_singularity(robot, 0.0, what=what) for what in ("closures", "motors")}
    return {what: max(float(event.function(0.0, q, still)), 0.0) for what, event in events.items()}


def holding(robot: HybridRobot, q: Array) -> tuple[Array | None, str]:
    """Compute the efforts that hold a posture at rest.

    Args:
        robot: The robot.
        q: The posture, shape (nq,).

    Returns:
        Efforts, shape (motors,), [N or N m], or None, and the reason if None.
    """
    if not robot.motors:
        return None, "there are no motors"
    still = np.zeros(robot.nv)
    try:
        return idm(robot, q, still, still), ""
    except HybridynError as error:
        return None, str(error).partition(". ")[0]


def status_html(message: str, residual: float | None) -> str:
    """Build the status line: the closure residual, or why a drag stopped.

    Args:
        message: Why a drag stopped, or an empty text.
        residual: Closure residual relative to the module's size; None if there are no loops.
    """
    closed = "no loops to close" if residual is None else f"loops closed to {residual:.0e}"
    colour, text = (ALARM, escape(message)) if message else (GOOD, closed)
    return (
        f'<div id="hybridyn-status" data-stopped="{int(bool(message))}" style="{SMALL};color:{colour}">'
        f"{text}</div>"
    )


def closeness_html(closeness: Mapping[str, float]) -> str:
    """Build the bars of the distances from singularities, on a logarithmic scale."""
    rows = []
    for label, value in closeness.items():
        colour = ALARM if value < AT_SINGULAR else WARNING if value < NEAR_SINGULAR else GOOD
        part = 1 + np.log10(max(value, 10.0**-DECADES)) / DECADES
        rows.append(_bar_row(label, f"{value:.2g}", 0.0, max(part, 0.02), colour))
    return (
        f'<div id="hybridyn-singularity" data-least="{min(closeness.values()):.6g}" style="{SMALL}" '
        'title="least singular value over the largest: 0 at a singularity, 1 at best">'
        f"<b>Distance from singularities</b>{''.join(rows)}</div>"
    )


def efforts_html(robot: HybridRobot, tau: Array | None, span: Array | None, origin: str) -> str:
    """Build effort bars grouped by module, each starting mid-track; red beyond a limit.

    Args:
        tau: Efforts, shape (motors,), [N or N m], or None.
        span: Efforts that scale the bars (full bar: largest of its unit), shape (..., motors), or None.
        origin: Source of the efforts, or the reason why there are none.
    """
    parts = [escape(origin)]
    units, limits = robot.effort_units, effort_limits(robot)
    scale = effort_scale(units, span)
    for number, module in enumerate(robot.modules):
        if tau is None or not module.motors:
            continue
        if len(module.motors) > 1:
            parts.append(f'<div style="color:{module_colour(number)}"><b>{escape(module.name)}</b></div>')
        for i in module.motor_index:
            part = float(np.clip(tau[i] / scale[i] if scale[i] else 0.0, -1, 1)) / 2
            text = f"{tau[i]:.4g} {units[i]}"
            colour = ALARM if abs(tau[i]) > limits[i] else module_colour(number)
            parts.append(_bar_row(escape(robot.motors[i]), text, 0.5 + min(part, 0), abs(part), colour))
    return f'<div id="hybridyn-efforts" style="{SMALL}">{"".join(parts)}</div>'


def legend_html(robot: HybridRobot) -> str:
    """Build the legend of colours."""
    shown = [k for k, module in enumerate(robot.modules) if module.closures or module.motors]
    entries = [(module_colour(k), robot.modules[k].name) for k in shown[:12]]
    if len(shown) > 12:
        entries.append(("transparent", f"and {len(shown) - 12} more"))
    entries += [(MOTOR, "motor"), (JOINT, "passive joint"), (CLOSURE, "closure")]
    squares = (
        f'<span style="white-space:nowrap;margin-right:0.9em"><span style="display:inline-block;width:0.8em;'
        f'height:0.8em;background:{colour};border-radius:0.15em"></span> {escape(name)}</span>'
        for colour, name in entries
    )
    return f'<div id="hybridyn-legend" style="{SMALL}">{" ".join(squares)}</div>'


def effort_limits(robot: HybridRobot) -> list[float]:
    """Return the limit of each motor's effort, inf if there is none."""
    return [robot.records[name].effort_limit for name in robot.motors]


def effort_scale(units: Sequence[str], span: Array | None) -> Array:
    """Compute the effort of a full bar for each motor: the largest of all motors with its unit.

    Args:
        units: Unit of each motor's effort.
        span: The efforts, shape (..., motors), or None.
    """
    scale = np.zeros(len(units))
    for unit in set(units) if span is not None else ():
        like = [i for i, other in enumerate(units) if other == unit]
        scale[like] = np.abs(np.asarray(span)[..., like]).max(initial=0.0)
    return scale


def _bar_row(label: str, text: str, start: float, width: float, colour: str) -> str:
    return (
        '<div style="display:flex;align-items:center;gap:0.5em">'
        '<span style="flex:0 0 38%;overflow:hidden;text-overflow:ellipsis;white-space:nowrap" '
        f'title="{label}">'
        f"{label}</span>"
        f'<span style="flex:1;height:0.55em;background:{TRACK};border-radius:0.2em;position:relative">'
        f'<span style="position:absolute;left:{100 * start:.1f}%;width:{100 * width:.1f}%;height:100%;'
        f'background:{colour};border-radius:0.2em"></span></span>'
        f'<span style="flex:0 0 6em;text-align:right;font-variant-numeric:tabular-nums">{text}</span></div>'
    )
