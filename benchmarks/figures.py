"""The figures of the report, from the committed results alone: log-log, one colour a method."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.descents import searches, shooting
from benchmarks.fronts import chosen, grouped, jacobians, ratios
from benchmarks.panels import LOOK, Curve, Panel, draw
from benchmarks.results import Row
from hybridyn.studies.cost.points import pareto_front

Results = dict[str, list[Row]]
COLOURS = {
    "hybridyn, compiled": "#0b4f9e",
    "hybridyn, compiled, float32": "#7b68c8",
    "hybridyn, compiled, dopri5": "#00676b",
    "hybridyn, compiled, law in Python": "#111111",
    "hybridyn, compiled, over motors": "#00a5ab",
    "hybridyn, general": "#3d9be9",
    "hybridyn, general, dopri5": "#00a5ab",
    "hybridyn, general, conserving": "#7b68c8",
    "hybridyn, general, implicit": "#5a6fd6",
    "pin.constraintDynamics": "#e07b00",
    "pin.computeConstraintDynamicsDerivatives": "#e07b00",
    "pin.lcaba": "#c22f1f",
    "pin.rnea + projection, dense": "#e07b00",
    "pin.rnea + projection, per module": "#c22f1f",
    "pin.rnea, loops open": "#b79f86",
    "rk4 on constraintDynamics, held by nothing": "#f2b36b",
    "rk4 on constraintDynamics, held by baumgarte": "#e07b00",
    "rk4 on constraintDynamics, held by projection": "#9c5400",
    "rk4 on lcaba, held by nothing": "#c22f1f",
    "MuJoCo": "#3f8f4f",
    "MuJoCo, Euler": "#8cc59a",
    "MuJoCo, implicitfast": "#8cc59a",
    "dense null space": "#8a8a8a",
    "pin.aba": "#7a3fa0",
    "pin.rnea": "#7a3fa0",
    "leg_inertia": "#0b4f9e",
    "velocity": "#00a5ab",
    "rotor_inertia": "#7a3fa0",
    "viscous_friction": "#e07b00",
    "coulomb_friction": "#c22f1f",
    "loky": "#0b4f9e",
}
#: Shades of the compiled model's colour, by the number of threads.
THREADS = {1: "#6f9fd8", 2: "#2f6fc0", 4: "#062c5a"}
OURS, FALLBACK = "hybridyn, compiled", "#555555"
#: Names of the axes by the field that they show.
AXES = {
    "us": "time per sample [us]",
    "error": "error, relative to the largest entry",
    "mib": "memory, from the loaded robot on [MiB]",
    "batch": "samples per call",
    "at": "modules",
    "energy": "energy drift, of the kinetic energy",
    "closure": "closure residual, of the module's length",
}
MODELS = {"ddm": "direct model", "idm": "inverse model"}
#: Robots whose errors and times are drawn; others are in the tables.
DRAWN = ("five_bar", "lx4", "stack 16")
#: Of the names inside an SVG, so that equal figures are equal files.
SEED = "hybridyn"
#: Beyond, an error says that there is no answer.
NO_ANSWER = 3.0


def colour(method: str) -> str:
    """Return a method's colour, whatever follows its name."""
    found = [name for name in COLOURS if method.startswith(name)]
    return COLOURS[max(found, key=len)] if found else FALLBACK


def label(row: Row, names: Sequence[str]) -> str:
    """Name a curve: the method without its setting, with what else makes the curve."""
    method = row.method.split(", mu")[0].split(", impedance")[0]
    if "batch" in names and row.batch > 1:
        return f"{method}, in batches"
    return f"{method}, {row.threads} threads" if row.threads > 1 and "threads" in names else method


def panel(
    rows: Sequence[Row], title: str, fields: tuple[str, str], names: Sequence[str] = ("method",), *,
    pareto: bool = False, look: Mapping[str, Any] | None = None,
) -> Panel:  # fmt: skip
    """Draw two fields of some rows against each other.

    Args:
        rows: The rows.
        title: Title of the panel.
        fields: Those along the horizontal and the vertical axis.
        names: Fields of which every value is a curve.
        pareto: Whether the front of a sweep is its curve; its other points are pale.
        look: Fields of the panel.
    """
    curves = []
    across, up = map(attrgetter, fields)
    shown = [row for row in rows if math.isfinite(across(row)) and math.isfinite(up(row))]
    for group in grouped(shown, *names).values():
        group = sorted(group, key=lambda row: (across(row), up(row)))
        swept = pareto and len({row.setting for row in group}) > 1
        best = pareto_front(group, across, up) if swept else group
        shade = THREADS.get(group[0].threads, "") if "threads" in names and group[0].method == OURS else ""
        behind = group if swept else []
        curve = Curve(
            label(group[0], names),
            shade or colour(group[0].method),
            [*map(across, best)],
            [*map(up, best)],
            hollow=[row.batch > 1 and fields[0] != "batch" for row in best],
            all_x=[*map(across, behind)],
            all_y=[*map(up, behind)],
        )
        curves.append(curve)
    x, y = (AXES.get(name, name) for name in fields)
    return Panel(title, **{"x": x, "y": y, "curves": curves, **(look or {})})


def models(results: Results) -> list[list[Panel]]:
    """Draw error against time of both models."""
    return [
        [
            panel([r for r in chosen(results[model], case=case) if r.error < NO_ANSWER],
                  f"{case}, {words}", ("us", "error"), pareto=True)
            for case in DRAWN
        ]
        for model, words in MODELS.items()
    ]  # fmt: skip


def scaling(results: Results) -> list[list[Panel]]:
    """Draw time and memory against the number of modules, one row a family."""
    wanted = (("ddm", "us"), ("idm", "us"), ("ddm", "mib"))
    names = ("method", "batch")
    return [
        [
            panel(chosen(own, model=model), f"{family}s, {MODELS[model]}", ("at", field), names)
            for model, field in wanted
        ]
        for family, own in grouped(results["scaling"], "case").items()
        if " " not in family
    ]


def overview(results: Results) -> list[list[Panel]]:
    """Draw what the README shows: the direct model of the LX4, and of stacks of more modules."""
    known = [row for row in chosen(results["ddm"], case="lx4") if row.error < NO_ANSWER]
    left = panel(known, "LX4: four modules, direct model", ("us", "error"), pareto=True)
    right = scaling({"scaling": chosen(results["scaling"], case="stack")})
    return [[left, *(replace(row[0], title="stacks of such modules") for row in right)]]


def simulation(results: Results) -> list[list[Panel]]:
    """Draw error of the final state, energy drift and closure residual against time."""
    motions, scenes = (grouped(results[name], "case") for name in ("simulation", "controlled"))
    wall = {"x": "wall time [s]"}
    state = wall | {"y": "error of the final state"}
    rows = [
        [panel(own, case, ("seconds", "error"), pareto=True, look=state) for case, own in motions.items()],
        [panel(own, case, ("seconds", "energy"), pareto=True, look=wall) for case, own in motions.items()],
        [
            panel(own, case, ("seconds", "error"), pareto=True, look=state | {"x": "processor time [s/s]"})
            for case, own in scenes.items()
        ],
    ]
    case = next(reversed(motions), "")
    rows[2] += [panel(motions[case], case, ("seconds", "closure"), pareto=True, look=wall)] if case else []
    return rows


def derivatives(results: Results) -> list[list[Panel]]:
    """Draw times of the direct model's derivatives against Pinocchio's, a point for each robot."""
    rows = [
        Row(one.case, method=f"{OURS}{words}", batch=row.batch, us=one.peer.us, value=row.us)
        for one in jacobians(results)
        if one.peer and one.model == "ddm_jacobian"
        for row, words in zip(one.ours, ("", "", ", over motors", ", over motors"), strict=True)
        if row
    ]
    look = {"x": "time of Pinocchio's [us]", "y": "time of hybridyn's [us]"}
    own = panel(rows, "ddm_jacobian", ("us", "value"), ("method", "batch"), look=look)
    return [[replace(own, curves=own.curves + _equal(own, lambda x: x))]]


def throughput(results: Results) -> list[list[Panel]]:
    """Draw time per sample against batch size, one curve for each method and number of threads."""
    rows = [r for r in results["throughput"] if r.threads == 1 or r.method == OURS]
    return [
        [
            panel(chosen(rows, case=case, model=model), f"{case}, {words}", ("batch", "us"),
                  names=("method", "threads"))
            for model, words in MODELS.items()
        ]
        for case in dict.fromkeys(row.case for row in rows)
    ]  # fmt: skip


def singular(results: Results) -> list[list[Panel]]:
    """Draw the error near singular postures against the distance."""
    rows = [row._replace(error=min(row.error, 30.0)) for row in results["singular"]]
    distance = {"x": "distance from the singular posture [rad]"}
    return [[panel(own, case, ("at", "error"), look=distance) for case, own in grouped(rows, "case").items()]]


def losses(results: Results) -> list[list[Panel]]:
    """Draw the ratio of times to the fastest peer against the peer's time, a point for each robot."""
    look = {"x": "time of the fastest peer [us]", "y": "time of hybridyn over the peer's"}
    out = []
    for model, words in MODELS.items():
        own = panel(ratios(results, [model]), words, ("us", "value"), ("method", "batch"), look=look)
        points = [replace(curve, joined=False) for curve in own.curves]
        out.append(replace(own, curves=points + _equal(own, lambda x: 1.0)))
    return [out]


def _equal(own: Panel, value: Callable[[float], float]) -> list[Curve]:
    """Return the line on which both are as fast."""
    ends = [x for curve in own.curves for x in curve.x]
    at = [min(ends), max(ends)] if ends else []
    return [Curve("as fast as the peer", FALLBACK, at, [*map(value, at)])] if ends else []


def sweeps(results: Results) -> list[list[Panel]]:
    """Draw what sweeps cost against the number of postures of each design."""
    rows = [
        row._replace(
            method=f"{row.method}, processes: {row.threads}, designs: {row.at:g}", us=row.batch, batch=1
        )
        for row in results["sweeps"]
    ]
    look = {"x": "postures of each design", "y": "processor time [s]"}
    return [[panel(rows, "five_bar", ("us", "seconds"), look=look)]]


def effects(results: Results) -> list[list[Panel]]:
    """Draw what each effect changes against what it costs."""
    rows = [row._replace(value=100 * row.value) for row in results["effects"]]
    look = {"x": "share of the operations [%]", "y": "change of the efforts without it"}
    return [[panel(own, case, ("value", "error"), look=look) for case, own in grouped(rows, "case").items()]]


def cold(results: Results) -> list[list[Panel]]:
    """Draw times of cold calls against those of hot ones."""
    look = {"x": "time of a hot call [us]", "y": "time of a cold call [us]"}
    rows = grouped(results["cold"], "case", "model").items()
    return [
        [panel(own, f"{case}, {MODELS[model]}", ("us", "median"), look=look) for (case, model), own in rows]
    ]


BETTER = "Lower left is better. Pale: all settings; line: the best. hybridyn: filled one call, open a batch."
FIGURES = (
    ("overview", "Efforts to accelerations", BETTER, overview),
    ("models", "What accuracy costs in time", BETTER, models),
    ("losses", "hybridyn against the fastest peer", "Points are robots. Lower is better.", losses),
    (
        "effects",
        "What effects are worth",
        "Upper left: needed and cheap. Lower right: leave it out.",
        effects,
    ),
    (
        "singular",
        "Close to singular postures",
        "Lower is better. Every method at its best setting.",
        singular,
    ),
    ("cold", "Cold calls", "Lower is better.", cold),
    ("derivatives", "Derivatives", "Points are robots. Lower is better. Open: in batches.", derivatives),
    ("sweeps", "What a sweep costs", "Lower is better.", sweeps),
    ("searches", "Searching for a design", "Lower left is better. Pale: all starts; line: median.", searches),
    ("shooting", "DDP on a leg with a parallel ankle", "Lower left is better.", shooting),
    ("scaling", "Cost against the number of modules", "Lower is better. Open: in batches.", scaling),
    ("throughput", "Batch size and threads", "Lower is better. Peers are called in a loop.", throughput),
    ("simulation", "Simulation: what accuracy costs in time", "Lower left is better.", simulation),
)


def write_figures(folder: Path, results: Results, suffix: str = ".svg") -> list[str]:
    """Write every figure that the results allow; give the names of what was drawn.

    Raises:
        ImportError: matplotlib is not installed.
    """
    from matplotlib import rc_context

    folder.mkdir(parents=True, exist_ok=True)
    drawn = []
    for name, title, remark, make in FIGURES:
        rows = [[panel for panel in row if panel.curves] for row in make(results)]
        if any(rows):
            figure = draw(title, remark, [row for row in rows if row])
            for ax in figure.axes:
                if ax.get_xlabel() == AXES["at"]:
                    counted = sorted(
                        {int(x) for line in ax.get_lines() for x in np.atleast_1d(line.get_xdata())}
                    )
                    ax.set_xticks(counted, [str(x) for x in counted])
            metadata = {"Date": None} if suffix == ".svg" else None
            with rc_context({"svg.hashsalt": SEED, **LOOK}):
                figure.savefig(folder / f"{name}{suffix}", metadata=metadata, dpi=100)
            drawn.append(name)
    return drawn
