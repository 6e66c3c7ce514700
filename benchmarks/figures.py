"""The figures of the report, from the committed results alone: log-log, named at the curves."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks.curves import Curve, Panel, draw
from benchmarks.fronts import front, grouped
from benchmarks.results import Flight, Near, Point, Size

OURS, GENERAL = "hybridyn, compiled", "hybridyn, general"
COLOURS = {
    "hybridyn, compiled": "#0b4f9e",
    "hybridyn, compiled, float32": "#7b68c8",
    "hybridyn, general": "#3d9be9",
    "pin.constraintDynamics": "#e07b00",
    "pin.lcaba": "#c22f1f",
    "pin.rnea + projection, dense": "#e07b00",
    "pin.rnea + projection, per module": "#c22f1f",
    "pin.rnea, loops open": "#b79f86",
    "MuJoCo": "#3f8f4f",
    "dense null space": "#8a8a8a",
    "pin.aba": "#7a3fa0",
    "pin.rnea": "#7a3fa0",
}
#: Shades of the compiled model's colour, by the number of threads; more are as dark as four.
THREADS = {1: "#6f9fd8", 2: "#2f6fc0", 3: "#0b4f9e", 4: "#062c5a"}

FALLBACK = "#555555"
ERROR = "error, relative to the largest entry"
#: What an error of nothing is drawn at.
LEAST_ERROR = 1e-17


class Figure(NamedTuple):
    """A figure.

    Attributes:
        name: Of its file.
        title: Over the panels.
        remark: How to read them.
        panels: Rows of panels.
    """

    name: str
    title: str
    remark: str
    panels: list[list[Panel]]


def colour(method: str) -> str:
    """Return a method's colour, whatever follows its name."""
    found = [name for name in COLOURS if method.startswith(name)]
    return COLOURS[max(found, key=len)] if found else FALLBACK


def named(method: str, batch: int = 0) -> str:
    """Name a curve: hybridyn's engine (and batch), or the method without its setting."""
    if not method.startswith("hybridyn"):
        return method.split(", mu")[0].split(", impedance")[0]
    engine = f"hybridyn {method.rpartition(', ')[2]}"
    return f"{engine}, batch of {batch:,}" if batch > 1 else f"{engine}, one call" if batch else engine


def work_precision(points: Sequence[Point], model: str, cases: Sequence[str]) -> Figure | None:
    """Draw error against time per sample, one panel a robot; the front of every sweep is the line."""
    panels = []
    for case in cases:
        own = [p for p in points if p.case == case and p.model == model and math.isfinite(p.us)]
        own = [p for p in own if p.error < 3.0]
        curves = []
        for method, group in grouped(own, "method").items():
            batches = method.startswith("hybridyn")
            best = front(group, lambda p: p.us, lambda p: p.error)
            if batches:  # in a batch, one call: joined by a line
                best = sorted(group, key=lambda p: -p.batch)
            x, y = work_and_error(best)
            curve = Curve(named(method), colour(method), x, y, *work_and_error(group))
            curves.append(replace(curve, first_open=batches and len(best) > 1))
        if curves:
            panels.append(Panel(case, "time per sample [us]", ERROR, curves, inside=True))
    if not panels:
        return None
    name = {"ddm": "Direct model: efforts to accelerations", "idm": "Inverse model: accelerations to efforts"}
    width = min(3, len(panels))
    rows = [panels[i : i + width] for i in range(0, len(panels), width)]
    remark = (
        "Lower left is better. Pale: all settings; line: the best. hybridyn: filled one call, open a batch."
    )
    return Figure(model, name[model], remark, rows)


def scaling(sizes: Sequence[Size]) -> Figure | None:
    """Draw time and memory against the number of modules, one column a family."""
    rows: list[list[Panel]] = []
    wanted: list[tuple[str, str, Callable[[Size], float], str]] = [
        ("ddm", "direct model", lambda s: s.us, "time per sample [us]"),
        ("idm", "inverse model", lambda s: s.us, "time per sample [us]"),
        ("ddm", "direct model", lambda s: s.mib, "memory, from the loaded robot on [MiB]"),
    ]
    for model, title, value, unit in wanted:
        panels = []
        for family, own in grouped(sizes, "family").items():
            curves = []
            for (method, batch), group in grouped(
                [s for s in own if s.model == model and math.isfinite(value(s))], "method", "batch"
            ).items():
                label = named(method, batch)
                at, values = [s.modules for s in group], [max(value(s), 0.1) for s in group]
                curves.append(Curve(label, colour(method), at, values, filled=batch == 1))
            if curves:
                panels.append(Panel(f"{title}, {family}s", "modules", unit, curves, counts=True))
        if panels:
            rows.append(panels)
    remark = "Lower is better. Every point in a process of its own. Open: in batches."
    return Figure("scaling", "Cost against the number of modules", remark, rows) if rows else None


def work_and_error(points: Sequence[Point]) -> tuple[list[float], list[float]]:
    """Return times and errors, none of them zero."""
    return [p.us for p in points], [max(p.error, LEAST_ERROR) for p in points]


def overview(points: Sequence[Point], sizes: Sequence[Size]) -> Figure | None:
    """Draw what the README shows: the direct model of the LX4, and of stacks of more modules."""
    precision, grown = (
        work_precision(points, "ddm", ["lx4"]),
        scaling([s for s in sizes if s.family == "stack"]),
    )
    if precision is None or grown is None:
        return None
    left = replace(precision.panels[0][0], title="LX4: four Gough-Stewart modules, direct model")
    right = replace(grown.panels[0][0], title="stacks of such modules, direct model")
    return Figure("overview", "Efforts to accelerations", precision.remark, [[left, right]])


def simulation(flights: Sequence[Flight]) -> Figure | None:
    """Draw error of the final state, energy drift and closure residual against time, one row a motion."""
    wanted: list[tuple[Callable[[Flight], float], str]] = [
        (lambda f: f.state, "error of the final state"),
        (lambda f: f.energy, "energy drift, of the kinetic energy"),
        (lambda f: f.closure, "closure residual, of the module's length"),
    ]
    rows = []
    for case, own in grouped(flights, "case").items():
        panels = []
        for value, name in wanted:
            curves = []
            for method, group in grouped([f for f in own if math.isfinite(value(f))], "method").items():
                swept = method.startswith("MuJoCo")  # over two settings; the others' points follow one
                best = front(group, lambda f: f.seconds, value) if swept else group
                values = [max(value(f), LEAST_ERROR) for f in best]
                style = METHOD_STYLES.get(method, (FALLBACK, method))
                curves.append(Curve(style[1], style[0], [f.seconds for f in best], values))
            if curves:
                panels.append(Panel(case, "wall time [s]", name, curves))
        rows.append(panels)
    remark = "Lower left is better."
    return Figure("simulation", "Simulation: what accuracy costs in time", remark, rows) if rows else None


METHOD_STYLES = {
    "hybridyn, general, rk4, closed in stages": ("#3d9be9", "general, rk4, closed in stages"),
    "hybridyn, general, rk4, closed after steps": ("#86c3f5", "general, rk4, closed after steps"),
    "hybridyn, general, rk4, not closed": ("#9db4c8", "general, rk4, not closed"),
    "hybridyn, compiled, rk4, closed in stages": ("#0b4f9e", "compiled, rk4, closed in stages"),
    "hybridyn, general, dopri5": ("#00a5ab", "general, dopri5"),
    "hybridyn, compiled, dopri5": ("#00676b", "compiled, dopri5"),
    "hybridyn, general, conserving": ("#7b68c8", "general, conserving"),
    "hybridyn, general, implicit": ("#5a6fd6", "general, implicit"),
    "rk4 on constraintDynamics, held by nothing": ("#f2b36b", "constraintDynamics, rk4"),
    "rk4 on constraintDynamics, held by baumgarte": ("#e07b00", "... with Baumgarte"),
    "rk4 on constraintDynamics, held by projection": ("#9c5400", "... with projection"),
    "rk4 on lcaba, held by nothing": ("#c22f1f", "lcaba, rk4"),
    "MuJoCo, Euler": ("#8cc59a", "MuJoCo, Euler"),
    "MuJoCo, RK4": ("#3f8f4f", "MuJoCo, RK4"),
}


def throughput(points: Sequence[Point], case: str) -> Figure | None:
    """Draw time per sample against batch size, one line for each method and number of threads."""
    panels = []
    for model, title in (("ddm", "direct model"), ("idm", "inverse model")):
        own = [p for p in points if p.case == case and p.model == model and math.isfinite(p.us)]
        curves = []
        for (method, threads), group in grouped(own, "method", "threads").items():
            label, shade = named(method), colour(method)
            if method == OURS:
                label += f", {threads} thread{'s' * (threads > 1)}"
                shade = THREADS[min(threads, max(THREADS))]
            elif threads > 1:  # float32 scales alike: the table has it
                continue
            curves.append(Curve(label, shade, [p.batch for p in group], [p.us for p in group]))
        if curves:
            panels.append(Panel(f"{case}, {title}", "samples per call", "time per sample [us]", curves))
    remark = "Lower is better. Peers are called in a loop."
    return Figure("throughput", "Throughput: batch size and threads", remark, [panels]) if panels else None


def singular(rows: Sequence[Near]) -> Figure | None:
    """Draw the error near singular postures against the distance, each method at its best setting there."""
    panels = []
    for case, own in grouped(rows, "case").items():
        own = [r for r in own if math.isfinite(r.distance)]
        curves = []
        for method, group in grouped(own, "method").items():
            best = {
                d: min((r.error for r in at if not math.isnan(r.error)), default=math.nan)
                for d, at in grouped(group, "distance").items()
            }
            kept = [(d, min(max(e, LEAST_ERROR), 30.0)) for d, e in sorted(best.items()) if not math.isnan(e)]
            if kept:
                x, y = zip(*kept, strict=True)
                curves.append(Curve(method, colour(method), list(x), list(y)))
        if curves:
            unit = "distance from the singular posture [rad]"
            panels.append(Panel(case, unit, ERROR, curves, reverse=True))
    remark = "Lower is better. Every method at its best setting for each distance."
    return Figure("singular", "Close to singular postures", remark, [panels]) if panels else None


def figures(results: dict[str, list[Any]]) -> list[Figure]:
    """Give every figure that the results allow."""
    points, chosen = (
        results["ddm"] + results["idm"],
        ("five_bar", "gough_stewart", "lx4", "stack 16", "snake 8"),
    )
    cases = [case for case in chosen if any(p.case == case for p in points)]
    found = [
        overview(points, results["scaling"]),
        work_precision(points, "ddm", [*cases, "ur5"]),
        work_precision(points, "idm", [*cases, "ur5"]),
        scaling(results["scaling"]),
        simulation(results["simulation"]),
        throughput(results["throughput"], results["throughput"][0].case if results["throughput"] else ""),
        singular(results["singular"]),
    ]
    return [figure for figure in found if figure is not None]


def write_figures(folder: Path, results: dict[str, list[Any]], suffix: str = ".svg") -> list[Figure]:
    """Write every figure; give what was drawn.

    Raises:
        ImportError: matplotlib is not installed.
    """
    drawn = figures(results)
    folder.mkdir(parents=True, exist_ok=True)
    for figure in drawn:
        draw(figure.title, figure.remark, figure.panels, folder / f"{figure.name}{suffix}")
    return drawn
