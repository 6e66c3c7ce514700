"""`hybridyn sweep`: evaluate the designs of a study in several processes, and find the best."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import click

from ..errors import HybridynError
from .common.engine import takes_engine
from .common.figures import plot_option, save_chart
from .common.progress import Progress
from .common.tables import jobs_option, pool_options
from .common.text import aligned_rows, counted

if TYPE_CHECKING:
    from ..studies.sweep.best import Best
    from ..studies.sweep.pools import PoolName
    from ..studies.sweep.sensitivity import Index
    from ..studies.sweep.sweep import Swept

#: Designs of the Pareto front that are printed; the others are counted.
MOST_PRINTED = 50


@click.command(
    "sweep",
    params=[
        plot_option("every measure over every parameter", page=True),
        jobs_option("one per core"),
        *pool_options(""),
    ],
    short_help="Evaluate many designs of a robot, and find the best.",
)
@click.argument("study", required=False, metavar="[STUDY]", type=click.Path(dir_okay=False))
@click.option("-o", "--output", metavar="FOLDER", default="results", show_default=True, help="The results.")
@click.option("--format", type=click.Choice(["parquet", "csv"]), help="Format of the shards.")
@click.option("--allow-python", is_flag=True, help="Allow measures that are functions of Python files.")
@takes_engine
@click.option(
    "--best", metavar="A,-B,...",
    help="Print the designs in which A is smallest and B largest; with several, the Pareto front.",
)  # fmt: skip
@click.option(
    "--where",
    metavar="CONDITION",
    help="Print only designs that satisfy this condition, such as 'reach > 0.2'.",
)
@click.option(
    "--top", type=click.IntRange(1, 10_000), default=10, show_default=True, help="Number of designs to print."
)
@click.option("--sensitivity", is_flag=True, help="Print the Sobol or Morris indices of the parameters.")
def command(
    study: str | None,
    output: str,
    pool: PoolName | None,
    scheduler: str | None,
    jobs: int | None,
    resume: bool,
    format: str | None,
    allow_python: bool,
    engine: str | None,
    best: str | None,
    where: str | None,
    top: int,
    sensitivity: bool,
    plot: str | None,
) -> int:
    """Evaluate the designs of STUDY (a TOML file), and find the best.

    A study names a robot, parameters with their values, tasks, and what is measured; docs/sweeps.md explains
    its keys. The results are written to FOLDER, one file (shard) per second of work; a shard is complete or
    does not exist. The rows are the same, bit for bit, for every pool and number of processes. Designs
    that do not load, and postures that are out of reach or singular, are counted and listed. Without STUDY,
    --best and --plot use the results of an earlier run:

    hybridyn sweep -o results --best "peak_effort" --where "reach > 0.2"
    """
    if study is None and best is None and plot is None and not sensitivity:
        raise click.UsageError(
            "give a STUDY to evaluate, or --best, --sensitivity or --plot to ask earlier results"
        )
    if where is not None and best is None and plot is None:
        raise click.UsageError("--where belongs to --best or --plot")
    if study is not None:
        _run(study, output, pool, scheduler, jobs, resume, allow_python, format, engine)
    if best is not None:
        from ..studies.sweep.best import find_best

        click.echo("\n".join(_table(find_best(output, best, where, top))))
    if sensitivity:
        click.echo("\n".join(_indices(output)))
    if plot is not None:
        from ..figures.sweep import chart_of_sweep

        save_chart(chart_of_sweep(output, where), plot)
    return 0


def _run(
    study: str, output: str, pool: PoolName | None, scheduler: str | None, jobs: int | None, resume: bool,
    allow_python: bool, format: str | None, engine: str | None,
) -> None:  # fmt: skip
    """Evaluate a study, and print what became of its designs."""
    from ..studies.sweep.sweep import sweep

    states: list[Swept] = []
    try:
        with Progress("designs") as bar:

            def show(state: Swept) -> None:
                """Keep the state of the sweep, and show it."""
                states[:] = [state]
                open_before = state.designs - state.done + state.now
                bar.show(state.now, state.now / open_before)

            state = sweep(
                study, output, pool=pool or "loky", jobs=jobs, scheduler=scheduler,
                resume=resume, allow_python=allow_python, format=format, compiled=engine != "general",
                progress=show,
            )  # fmt: skip
    except BaseException:
        if states:
            click.echo(
                f"{states[0].done:,} of {counted(states[0].designs, 'design')} are done, in '{output}'; "
                "continue with --resume", err=True,
            )  # fmt: skip
        raise
    for line in _summary(state, output, engine):
        click.echo(line, err=True)
    if engine == "compiled" and state.why_general:
        raise HybridynError(f"--engine compiled: {state.why_general}")


def _summary(state: Swept, output: str, engine: str | None) -> list[str]:
    """Return the lines that say what became of the designs."""
    lines = [f"{counted(state.done, 'design')} in '{output}', {state.now:,} evaluated now"]
    statuses = sorted(state.statuses, key=lambda status: (status != "ok", status))
    lines += [f"  {status}: {state.statuses[status]:,}" for status in statuses]
    if state.unreachable or state.singular:
        lines.append(f"postures out of reach: {state.unreachable:,}; singular: {state.singular:,}")
    if state.compiled:
        lines.append(f"by compiled models: {state.compiled:,}")
        lines.append(
            f"compared with robots built for their designs: {state.checked:,}, largest difference "
            f"{state.difference:.1e}"
        )
    elif state.now:
        why = "as asked" if engine == "general" else "compiling takes longer than these designs"
        lines.append(f"by the general path, without compiled models: {state.why_general or why}")
    if state.restarts:
        lines.append(
            f"a worker process died {counted(state.restarts, 'time')}; its designs were evaluated again"
        )
    if state.now:
        share = state.work / (state.seconds * max(state.workers, 1)) if state.seconds > 0 else 1.0
        lines.append(
            f"{state.work / state.now * 1e3:.3g} ms per design, {counted(state.workers, 'worker')} busy "
            f"{share:.0%}, wall time {state.seconds:.2f} s"
        )
    return lines


def _table(found: Best) -> list[str]:
    """Return the best designs, and the Pareto front of several objectives, as aligned text."""
    lines = [f"{found.considered:,} of {counted(found.designs, 'design')} considered"]
    lines += [f"  left out: {count:,} {why}" for why, count in found.left_out.items() if count]
    several = len(found.objectives) > 1
    for title, rows in (("best", found.rows), ("Pareto front", found.front if several else [])):
        if rows:
            more = f" ({len(rows):,} designs, {MOST_PRINTED} printed)" if len(rows) > MOST_PRINTED else ""
            lines.append(f"{title}{more}")
            cells = [[f"{value:.6g}" for value in row] for row in rows[:MOST_PRINTED]]
            aligned = aligned_rows([list(found.columns), *cells], right=range(len(found.columns)))
            lines += [f"  {line}" for line in aligned]
    return lines


def _indices(output: str) -> list[str]:
    """Return the sensitivity indices as aligned text: a row per measure, a column per parameter."""
    from ..studies.sweep.sensitivity import KINDS, sensitivity

    found = sensitivity(output)
    parameters = list(dict.fromkeys(one.parameter for one in found))
    rows = []
    for kind in dict.fromkeys(one.kind for one in found):
        rows.append([KINDS[kind], *parameters])
        for measure in dict.fromkeys(one.measure for one in found):
            cells = [_index(one) for one in found if (one.measure, one.kind) == (measure, kind)]
            rows.append([measure, *cells])
    return aligned_rows(rows, right=range(1, len(rows[0])))


def _index(one: Index) -> str:
    """Return an index with its bound: parts of the variance with two decimals, others with three digits."""
    digits = ".2f" if one.kind in ("first", "total") else ".3g"
    return f"{one.value:{digits}}" + ("" if math.isnan(one.bound) else f" ± {one.bound:{digits}}")
