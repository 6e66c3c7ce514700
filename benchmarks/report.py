"""The report, generated from the results alone: each question with one table and one figure."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks import texts
from benchmarks.descents import iterated, searched
from benchmarks.fronts import chosen, exponent, fastest, grouped, jacobians, ratios, standings
from benchmarks.goals import GOALS, reached
from benchmarks.results import CHECK, NAN, SECTIONS, Row, measured_on, read_machines, read_rows
from benchmarks.texts import number, table

#: Folder of the rows of `benchmarks.batches`.
RESULTS = Path(__file__).parent / "results"
Results = dict[str, list[Row]]
Table = tuple[Sequence[str], list[list[str]]]

#: Errors of a simulation's final state.
WANTED = (1e-3, 1e-6, 1e-9)
#: Number of modules at which memory is compared: the most that every peer was tried with.
MODULES = 16
#: Engines of the batches and types of their numbers; the first also tells what was not measured.
BATCHED = (("hybridyn.warp", "float64"), ("hybridyn.warp", "float32"), ("mujoco_warp", "float32"))
#: Cores for which the rate of a sweep is stated, and seconds of a day.
CORES, DAY = 1000, 86400.0


class Question(NamedTuple):
    """A question of the report.

    Attributes:
        title: The question.
        words: What table and figure show.
        files: The sections whose rows it quotes.
        table: Gives the table.
        figure: Name of the figure, empty for none.
    """

    title: str
    words: str
    files: tuple[str, ...]
    table: Callable[[Results], Table]
    figure: str = ""


def write_report(folder: Path) -> Path:
    """Write report and figures from the results in a folder."""
    results = read_results(folder / "results")
    try:
        from benchmarks.figures import write_figures

        drawn = write_figures(folder / "figures", results)
    except ImportError:
        drawn = []
    path = folder / "report.md"
    path.write_text(report(results, read_machines(folder / "results" / "machine.csv"), drawn))
    return path


def read_results(folder: Path) -> Results:
    """Read every section."""
    return {section: read_rows(folder / f"{section}.csv") for section in SECTIONS}


def report(results: Results, machines: dict[str, dict[str, str]], drawn: Sequence[str]) -> str:
    """Write the report.

    Args:
        results: The rows of every section.
        machines: Facts about machine and versions, by section.
        drawn: Names of the figures that were drawn.

    Returns:
        Markdown.
    """
    parts = [texts.HEAD]
    for question in QUESTIONS:
        head, rows = question.table(results)
        parts.append(f"## {question.title}\n\n{question.words}")
        if question.figure in drawn:
            parts.append(f"![{question.title}](figures/{question.figure}.svg)\n")
        known = [name for name in question.files if results[name]]
        missing = " ".join(name for name in question.files if name not in known)
        if rows:
            parts.append(table(head, rows))
        if known:
            full = ", ".join(f"[{name}.csv](results/{name}.csv)" for name in known)
            parts.append(f"Rows in full: {full}. Measured: {measured_on(machines, known)}.\n")
        if missing:
            parts.append(f"Not measured yet; `python -m benchmarks --full --only {missing}` does.\n")
    parts += [texts.LIMITS, table(*_files(results)), *_machines(machines)]
    return "\n".join(parts)


def against(results: Results) -> Table:
    """Compare the models with the fastest peer, a line for each robot."""
    head = ["robot"]
    for model in ("ddm", "idm"):
        head += [f"{model}: fastest peer", "us", "error", "hybridyn, a call", "in a batch", "error"]
    lines: dict[str, list[str]] = {}
    for one in standings(results, ("ddm", "idm")):
        line = lines.setdefault(one.case, [one.case])
        line += [one.peer.method.removeprefix("pin.rnea + "), number(one.peer.us), number(one.peer.error)]
        ours = [one.ours("hybridyn", batch) for batch in (False, True)]
        line += [_beside(row.us if row else NAN, one.peer.us) for row in ours]
        line.append(number(max((row.error for row in ours if row), default=NAN)))
    return head, list(lines.values())


def losses(results: Results) -> Table:
    """Say on which robots each engine is slower than the fastest peer, and by how much."""
    rows = []
    for (engine, model, batch), own in grouped(ratios(results), "method", "model", "batch").items():
        lost = [row.case for row in own if row.value > 1]
        worst = max(own, key=lambda row: row.value)
        won = [row.case for row in own if row.value <= 1]
        where = ", ".join(lost) if len(lost) <= len(won) else f"all but {', '.join(won) or 'none'}"
        how = "one call" if batch == 1 else "batch"
        rows.append(
            [engine, model, how, f"{len(lost)} of {len(own)}", where, f"{_bold(worst.value)} ({worst.case})"]
        )
    head = ["engine", "model", "", "slower on", "which", "largest ratio of times"]
    return head, sorted(rows, key=lambda line: line[0])


def missed(results: Results) -> Table:
    """List the goals that are missed, after a line that counts them."""
    known = [one for one in reached(results) if not math.isnan(one.value)]
    lost = [one for one in known if not one.met]
    rows = [[f"{len(known) - len(lost)} of {len(known)} goals are met", "", ""]] if known else []
    for goal in dict.fromkeys(id(one.goal) for one in lost):
        own = [one for one in lost if id(one.goal) == goal]
        first = own[0].goal
        limit = f"at {'least' if first.at_least else 'most'} {first.limit:.3g} {first.rows.get('unit', '')}"
        rows.append([first.what, limit.rstrip(), ", ".join(f"{one.case} {number(one.value)}" for one in own)])
    return ["goal", "wanted", "reached"], rows


def effects(results: Results) -> Table:
    """List what each effect changes, and its share of the operations."""
    rows = [[r.case, r.method, number(r.error), f"{r.value:.1%}"] for r in results["effects"]]
    return ["robot", "effect", "change of the efforts without it", "share of the operations"], rows


def grown(results: Results) -> Table:
    """List what losses that grow with load cost in compiled models."""
    rows = [
        [r.case, r.model, r.method, f"{r.iterations:.0f}", *ratios_of(r), number(r.us), number(r.error)]
        for r in results["losses"]
    ]
    head = ["robot", "model", "loss", "iterations", "operations over those without", "time over that without"]
    return [*head, "us", "error"], rows


def ratios_of(row: Row) -> list[str]:
    """Write the ratios of operations and of times of a row."""
    return [f"{row.operations:.2f}", f"{row.value:.2f}"]


def singular(results: Results) -> Table:
    """Give every method's error by distance."""
    rows = [r for r in results["singular"] if r.model != CHECK and not math.isnan(r.at)]
    return _pivot(rows, ("case", "method"), "at", lambda own: number(own[0].error) or "refused", every=4)


def cold(results: Results) -> Table:
    """List times of cold and of hot calls beside the code."""
    rows = [
        [r.case, r.model, r.method, number(r.median), number(r.us), number(r.value / 1024)]
        for r in results["cold"]
    ]
    return ["robot", "model", "method", "cold [us]", "hot [us]", "code [KiB]"], rows


def batches(_: Results) -> Table:
    """List the most samples a second on a GPU by engine and numbers, and how long NVRTC builds each model."""
    rows = list(csv.DictReader((RESULTS / "batches.csv").read_text().splitlines()))
    best: dict[tuple[str, ...], dict[str, str]] = {}
    for row in sorted((r for r in rows if r["per_second"]), key=lambda r: float(r["per_second"])):
        best[row["robot"], row["model"], row["engine"], row["dtype"]] = row
    lines = []
    for built in (row for row in rows if row["engine"] == "NVRTC"):
        robot, model = built["robot"], built["model"].partition("_")[0]
        host = best.get((robot, model, "compile", "float64"))
        for engine, dtype in BATCHED:
            one, first = best.get((robot, model, engine, dtype)), (engine, dtype) == BATCHED[0]
            if one is None and not first:
                continue
            speed = (
                [one["device"], one["date"], number(float(one["per_second"])), one["samples"]]
                if one
                else ["not measured", "", "", ""]
            )
            error = number(float(one["error"])) if one and one["error"] else ""
            more = [number(float(host["per_second"])) if first and host else ""]
            more += [number(float(built["seconds"])), built["date"]] if first else ["", ""]
            lines.append([robot, model, engine, dtype, *speed, error, *more])
    head = ["robot", "model", "engine", "numbers", "device", "date", "samples a second", "of", "open by [m]"]
    return [*head, "compile", "NVRTC [s]", "date"], lines


def derivatives(results: Results) -> Table:
    """Compare derivatives with Pinocchio's, a line for each robot and model."""
    lines = []
    for one in jacobians(results):
        us, error = (one.peer.us, one.peer.error) if one.peer else (NAN, NAN)
        worst = max((row.error for row in one.ours if row), default=NAN)
        times = [_beside(row.us if row else NAN, us) for row in one.ours]
        lines.append([one.case, one.model, number(us), number(error), *times, number(worst)])
    head = ["robot", "derivatives", "Pinocchio [us]", "error", "all joints, a call", "in a batch"]
    return [*head, "over motors, a call", "in a batch", "error"], lines


def sweeps(results: Results) -> Table:
    """Give the costs of a design by least squares, and those of the engines."""
    runs = results["sweeps"]
    if not runs:
        return [], []
    alone = chosen(runs, "loky", threads=1)
    shapes = [[1.0, r.at, r.at * r.batch] for r in alone]
    fitted = np.linalg.lstsq(np.array(shapes), [r.seconds for r in alone], rcond=None)[0]
    start, design, posture = (float(x) for x in fitted)
    few = min(r.batch for r in alone)
    each = design + few * posture
    rows = [
        ["start of a sweep", f"{start:.1f} s", ""],
        ["a design, without postures", f"{1e3 * design:.0f} ms", ""],
        ["a posture", f"{1e3 * posture:.2f} ms", ""],
        [f"a design with {few} postures", f"{1e3 * each:.0f} ms", ""],
        [f"such designs on {CORES:,} cores in a day", f"{CORES * DAY / each / 1e6:.0f} million", ""],
    ]
    for r in runs:
        if (r.at, r.batch) == (max(run.at for run in runs), few):
            what = f"{r.at:.0f} such designs by {r.method}, {r.threads} process{'es' * (r.threads > 1)}"
            rows.append([what, f"{r.seconds:.1f} s", f"{r.value:.1f} s"])
    return ["", "processor time", "by the clock"], rows


def modules(results: Results) -> Table:
    """Give times by number of stacked modules, their growth, and memory."""
    rows = [
        r
        for r in chosen(results["scaling"], case="stack")
        if r.batch in (1, 500) and r.model in ("ddm", "idm")
    ]
    rows = [r for r in rows if math.isfinite(r.us) and not r.method.startswith("dense")]
    head, lines = _pivot(rows, ("model", "method", "batch"), "at", lambda own: number(own[0].us), every=2)
    for line, own in zip(lines, grouped(rows, "model", "method", "batch").values(), strict=True):
        slopes = [exponent([r.at for r in own], [getattr(r, name) for r in own]) for name in ("us", "mib")]
        most = next((r.mib for r in own if r.at == MODULES), NAN)
        line += [f"n^{slopes[0]:.2f}" if slopes[0] > -1 else "", number(most)]
        line.append(f"n^{slopes[1]:.2f}" if slopes[1] > -1 else "")
    return [*head, "growth", f"MiB at {MODULES}", "growth"], lines


def tools(results: Results) -> Table:
    """Give times of a row of a tool's pose by number of modules, and each over that of four."""
    rows = chosen(results["tools"], case="stack")
    each = [r.us / r.at for r in rows]
    growth = exponent([r.at for r in rows], [r.us for r in rows])
    lines = [
        ["a row [ms]", *(number(r.us / 1e3) for r in rows), f"n^{growth:.2f}" if growth > -1 else ""],
        ["a row and module, over the first", *(number(x / each[0]) for x in each), ""],
    ]
    return ["modules", *(f"{r.at:.0f}" for r in rows), "growth"], lines if rows else []


def simulation(results: Results) -> Table:
    """Give the fastest runs that reach an error, of each motion and scene."""
    lines = []
    for case, own in grouped(results["simulation"] + results["controlled"], "case").items():
        for error in WANTED:
            ours, peer = fastest(own, error)
            runs = [_run(ours), _run(peer)]
            ratio = _bold(ours.seconds / peer.seconds) if ours and peer else ""
            lines.append([case, f"{error:.0e}", *runs[0], *runs[1], ratio])
    return ["motion", "error", "hybridyn", "s", "fastest peer", "s", "ratio"], lines


def throughput(results: Results) -> Table:
    """Give times of the LX4 by size of the batch and number of threads."""
    rows = [r for r in chosen(results["throughput"], case="lx4") if math.isfinite(r.us)]
    rows = [r for r in rows if r.threads == 1 or r.method == "hybridyn, compiled"]
    return _pivot(rows, ("model", "method", "threads"), "batch", lambda own: number(own[0].us))


def around(results: Results) -> Table:
    """Give what a user's program waits for, a column for each robot."""
    left_out = ("operations with the guard [", "operations without", "from Python, 9", "import pinocchio [s]")
    rows = [row._replace(setting=f"{row.setting} [{row.unit or 'ratio'}]") for row in results["programs"]]
    rows = [row for row in rows if not row.setting.startswith(left_out) and not math.isnan(row.value)]
    return _pivot(rows, ("model", "setting"), "case", lambda own: number(own[0].value))


def _pivot(
    rows: Sequence[Row], names: Sequence[str], column: str, cell: Callable[[list[Row]], str], every: int = 1
) -> Table:
    """Write rows with one line for some fields, and one column for every value of another."""
    values = list(dict.fromkeys(getattr(row, column) for row in rows))
    if column != "case":
        values = sorted(values)[::every]
    lines = []
    for key, own in grouped(rows, *names).items():
        at: dict[Any, list[Row]] = grouped(own, column)
        lines.append([*map(str, key), *(cell(at[value]) if value in at else "" for value in values)])
    return [*names, *(x if isinstance(x, str) else f"{x:,g}" for x in values)], lines


def _run(row: Row | None) -> list[str]:
    """Write who ran at which setting, and its time."""
    if row is None:
        return ["none", ""]
    return [f"{row.method.removeprefix('hybridyn, ')}, {row.setting}", number(row.seconds)]


def _beside(us: float, peer: float) -> str:
    """Write a time, and its ratio to a peer's."""
    return f"{number(us)} ({_bold(us / peer)})" if math.isfinite(us / peer) else number(us)


def _bold(ratio: float) -> str:
    """Write a ratio of times; bold if hybridyn is slower."""
    return f"**{ratio:.2g}**" if ratio > 1 else f"{ratio:.2g}"


def _files(results: Results) -> Table:
    """List the files of the rows; checks, and why something was not measured, are in them."""
    lines = [
        [f"[{name}.csv](results/{name}.csv)" if rows else name, SECTIONS[name], f"{len(rows):,}"]
        for name, rows in results.items()
    ]
    return ["file", "what it holds", "rows"], lines


def _machines(machines: dict[str, dict[str, str]]) -> Iterator[str]:
    """Write the machines and versions with their sections."""
    where: dict[str, list[str]] = {}
    for section, facts in machines.items():
        beside = ("commit", "date", "load before")
        said = ", ".join(f"{name} {value}" for name, value in facts.items() if name not in beside)
        where.setdefault(said, []).append(section)
    for said, sections in where.items():
        yield f"- {', '.join(sections)}: {said or 'not recorded'}."
    yield "\nLoad, commit and date of each section: [machine.csv](results/machine.csv).\n"


QUESTIONS = (
    Question("How fast and how exact, against whom?", texts.AGAINST, ("ddm", "idm"), against, "models"),
    Question("Where does hybridyn lose?", texts.LOSSES, ("ddm", "idm", "derivatives"), losses, "losses"),
    Question("Which goals are missed?", texts.GOALS, tuple({goal.section: None for goal in GOALS}), missed),
    Question("What does an effect cost?", texts.EFFECTS, ("effects",), effects, "effects"),
    Question("What do losses that grow with load cost?", texts.GROWN, ("losses",), grown),
    Question("What happens near singularities?", texts.SINGULAR, ("singular",), singular, "singular"),
    Question("What does a cold call cost?", texts.COLD, ("cold",), cold, "cold"),
    Question("How fast are batches on a GPU?", texts.BATCHES, (), batches),
    Question("What do derivatives cost?", texts.DERIVATIVES, ("derivatives",), derivatives, "derivatives"),
    Question("What does a sweep cost?", texts.SWEEPS, ("sweeps",), sweeps, "sweeps"),
    Question("How much work does a search need?", texts.SEARCHES, ("searches",), searched, "searches"),
    Question(
        "What do second derivatives save in optimal control?",
        texts.SHOOTING,
        ("shooting",),
        iterated,
        "shooting",
    ),
    Question("What does a module cost?", texts.MODULES, ("scaling",), modules, "scaling"),
    Question("What does a tool's pose cost?", texts.TOOLS, ("tools",), tools),
    Question(
        "What does a simulation cost?",
        texts.SIMULATION,
        ("simulation", "controlled"),
        simulation,
        "simulation",
    ),
    Question(
        "What do batches and threads gain?",
        texts.THROUGHPUT,
        ("throughput", "peak"),
        throughput,
        "throughput",
    ),
    Question("What does a program wait for?", texts.PROGRAMS, ("programs", "quantities"), around),
)
