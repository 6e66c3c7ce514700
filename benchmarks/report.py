"""The report, generated from the results alone."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from benchmarks.fronts import cheapest, exponent, grouped
from benchmarks.reached import around, reached
from benchmarks.results import SECTIONS, Check, read_machines, read_rows
from benchmarks.standing import fastest, flown, losses, standing
from benchmarks.tables import number, table
from benchmarks.texts import (
    CALLGRIND,
    CONTROLLED,
    DERIVATIVES,
    HEAD,
    JOB,
    LIMITS,
    METHODS,
    OVER_MOTORS,
    PEAK,
    SINGULAR,
    THROUGHPUT,
)

Results = dict[str, list[Any]]

#: Cases of one reason that are written out.
MOST_NAMED = 6


def write_report(folder: Path) -> Path:
    """Write report and figures from the results in a folder."""
    results = read_results(folder / "results")
    try:
        from benchmarks.figures import write_figures

        drawn = [figure.name for figure in write_figures(folder / "figures", results)]
    except ImportError:
        drawn = []
    path = folder / "report.md"
    path.write_text(report(results, read_machines(folder / "results" / "machine.csv"), drawn))
    return path


def read_results(folder: Path) -> Results:
    """Read every section, and the gate."""
    out: Results = {section: read_rows(folder / f"{section}.csv", kind) for section, kind in SECTIONS.items()}
    out["gate"] = read_rows(folder / "gate.csv", Check)
    return out


def report(results: Results, machines: dict[str, dict[str, str]], drawn: Sequence[str]) -> str:
    """Write the report.

    Args:
        results: The rows of every section.
        machines: Facts about machine and versions, by section.
        drawn: Names of the figures that were drawn.

    Returns:
        Markdown.
    """
    titles: list[tuple[str, str, Callable[[Results], Iterator[str]]]] = [
        ("ddm", "Direct model", lambda r: _models(r, "ddm")),
        ("idm", "Inverse model", lambda r: _models(r, "idm")),
        ("scaling", "Cost against the number of modules", _scaling),
        ("simulation", "Simulation", _simulation),
        ("controlled", "Scenes with controllers", _controlled),
        ("throughput", "Throughput", _throughput),
        ("derivatives", "Derivatives", _derivatives),
        ("singular", "Close to singular postures", _singular),
        ("callgrind", "Instructions", _callgrind),
        ("peak", "Share of the peak rate", _peak),
        ("job", "The main job", _job),
        ("programs", "Around the models", around),
    ]
    parts = [HEAD, *standing(results), *losses(results), *reached(results), METHODS]
    for name, title, body in titles:
        if results[name]:
            parts.append(f"## {title}\n")
            if name in drawn:
                parts.append(f"![{title}](figures/{name}.svg)\n")
            parts += body(results)
    parts += [*_gate(results), *_missing(results), LIMITS, *_machines(machines)]
    return "\n".join(parts)


def _models(results: Results, model: str) -> Iterator[str]:
    yield "Time per sample [us]: the fastest setting with an error of at most 1e-10, or the most exact.\n"
    own = [p for p in results[model] if math.isfinite(p.us)]
    columns = list(grouped(own, "method"))
    head = ["robot"]
    for name in columns:
        head += [f"{name}, one call", f"{name}, batch"] if name.startswith("hybridyn") else [name]
    rows = []
    for case, points in grouped(own, "case").items():
        row = [case]
        for name in columns:
            of = [p for p in points if p.method == name]
            if name.startswith("hybridyn"):
                row += [_cell([p for p in of if p.batch == 1]), _cell([p for p in of if p.batch > 1])]
            else:
                row.append(_cell(of))
        rows.append(row)
    yield table(head, rows)


def _cell(points: Sequence[Any]) -> str:
    best = cheapest(points)
    if best is None:
        return ""
    return number(best.us) if best.error <= 1e-10 else f"{number(best.us)} (error {best.error:.0e})"


def _scaling(results: Results) -> Iterator[str]:
    for family, own in grouped(results["scaling"], "family").items():
        sizes = sorted({s.modules for s in own})
        yield f"### {family}s\n"
        for field, unit in (("us", "time per sample [us]"), ("mib", "memory [MiB]")):
            rows = []
            for (model, method, batch), group in grouped(own, "model", "method", "batch").items():
                at = {s.modules: getattr(s, field) for s in group}
                series = [at.get(size, math.nan) for size in sizes]
                if not any(map(math.isfinite, series)):
                    continue
                slope = exponent(sizes, series)
                cells = ["" if math.isnan(x) else number(x) for x in series]
                fit = "" if math.isnan(slope) else f"n^{slope:.2f}"
                rows.append([model, method, f"{batch:,}", *cells, fit])
            yield table([unit, "method", "batch", *map(str, sizes), "fit, n >= 4"], rows)


def _simulation(results: Results) -> Iterator[str]:
    for case, own in grouped(results["simulation"], "case").items():
        yield f"### {case}\n"
        rows = [
            [
                f.method,
                f.setting,
                number(f.seconds),
                number(f.state),
                number(f.energy),
                number(f.closure),
                f.note,
            ]
            for f in own
            if math.isfinite(f.seconds)
        ]
        yield table(["method", "setting", "time [s]", "final state", "energy", "closures", ""], rows)
        yield from flown(own)


def _controlled(results: Results) -> Iterator[str]:
    yield CONTROLLED
    for case, own in grouped(results["controlled"], "case").items():
        yield f"### {case}\n"
        rows = [
            [r.method, r.setting, number(r.per_second), f"{r.steps:,}", number(r.error), r.note]
            for r in own
            if math.isfinite(r.per_second)
        ]
        yield table(["method", "setting", "time [s/s]", "steps", "final state", ""], rows)
        yield from fastest(own)


def _throughput(results: Results) -> Iterator[str]:
    yield THROUGHPUT
    own = [p for p in results["throughput"] if math.isfinite(p.us)]
    sizes = sorted({p.batch for p in own})
    rows = []
    for (case, model, method, threads), group in grouped(own, "case", "model", "method", "threads").items():
        at = {p.batch: p.us for p in group}
        rows.append([case, model, method, str(threads), *(number(at.get(size, math.nan)) for size in sizes)])
    yield table(["robot", "model", "method", "threads", *(f"{size:,}" for size in sizes)], rows)


def _derivatives(results: Results) -> Iterator[str]:
    yield DERIVATIVES
    if any(p.model.endswith("over motors") for p in results["derivatives"]):
        yield OVER_MOTORS
    rows = [
        [p.model, p.case, p.method, p.setting, f"{p.batch:,}", number(p.error), number(p.us)]
        for p in results["derivatives"]
        if math.isfinite(p.us)
    ]
    yield table(["model", "robot", "method", "", "batch", "error", "us"], rows)


def _singular(results: Results) -> Iterator[str]:
    yield SINGULAR
    for case, own in grouped(results["singular"], "case").items():
        own = [r for r in own if math.isfinite(r.distance)]
        distances = sorted({r.distance for r in own}, reverse=True)[::2]
        rows = []
        for method, group in grouped(own, "method").items():
            cells = []
            for distance in distances:
                errors = [r.error for r in group if r.distance == distance and not math.isnan(r.error)]
                cells.append(number(min(errors)) if errors else "refused")
            rows.append([method, *cells])
        yield table([case, *(f"{d:.0e}" for d in distances)], rows)


def _callgrind(results: Results) -> Iterator[str]:
    yield CALLGRIND
    times = {
        (p.case, p.model, p.method, p.setting, p.batch > 1): p.us
        for p in results["ddm"] + results["idm"]
        if math.isfinite(p.us)
    }
    rows = []
    for c in results["callgrind"]:
        if math.isfinite(c.instructions):
            us = times.get((c.case, c.model, c.method, c.setting, c.batch > 1), math.nan)
            name = f"{c.method}, {c.setting}" if c.setting else c.method
            own = number(c.own) if c.own else ""
            rows.append([c.case, c.model, name, str(c.batch), number(c.instructions), own, number(us)])
    head = ["robot", "model", "method", "batch", "instructions", "in its own library", "time [us]"]
    yield table(head, rows)


def _peak(results: Results) -> Iterator[str]:
    yield PEAK.format(cores=max(r.cores for r in results["peak"]))
    rows = [
        [r.case, r.model, f"{r.operations:,}", number(r.us), number(r.operations / r.us / 1e3),
         number(r.peak), number(r.operations / r.peak / 1e3), f"{r.share:.0%}"]
        for r in results["peak"]
    ]  # fmt: skip
    head = [
        "robot",
        "model",
        "operations",
        "time [us]",
        "1e9 / s",
        "peak [1e9 / s]",
        "at the peak [us]",
        "share",
    ]
    yield table(head, rows)


def _job(results: Results) -> Iterator[str]:
    yield JOB
    rows = [[str(j.cores), f"{j.rows:,}", number(j.seconds), number(j.mib)] for j in results["job"]]
    yield table(["cores", "rows", "wall time [s]", "peak memory [MiB]"], rows)


def _gate(results: Results) -> Iterator[str]:
    yield "## Checks of models and references\n"
    yield "Largest difference, relative to the largest entry. If it exceeds its limit, no time is measured.\n"
    rows = [
        [c.case, c.what, number(c.error), "" if math.isnan(c.limit) else number(c.limit)]
        for c in results["gate"]
    ]
    yield table(["robot", "what", "error", "limit"], rows)


def _missing(results: Results) -> Iterator[str]:
    """List what was not measured, with the reason."""
    found: dict[tuple[str, str], list[str]] = {}
    for section, rows in results.items():
        for row in rows:
            if section != "gate" and row.note if hasattr(row, "note") else False:
                case = (
                    getattr(row, "case", "") or f"{getattr(row, 'family', '')} {getattr(row, 'modules', '')}"
                )
                cases = found.setdefault((row.method, row.note), [])
                if case not in cases:
                    cases.append(case)
    if found:
        yield "## Not measured\n"
        yield table(["method", "why", "where"], [[*key, _where(cases)] for key, cases in found.items()])


def _where(cases: Sequence[str]) -> str:
    return ", ".join(cases) if len(cases) <= MOST_NAMED else f"{len(cases)} cases"


def _machines(machines: dict[str, dict[str, str]]) -> Iterator[str]:
    """Write the machine: what is common once, the rest by section."""
    if not machines:
        return
    yield "## Machine and versions\n"
    names = list(next(iter(machines.values())))
    each = list(machines.values())
    common = [name for name in names if len({facts.get(name) for facts in each}) == 1]
    yield table(["", ""], [[name, each[0][name]] for name in common])
    rest = [name for name in names if name not in common]
    if rest:
        rows = [[section, *(facts.get(name, "") for name in rest)] for section, facts in machines.items()]
        yield table(["section", *rest], rows)
