"""`hybridyn sweep`: evaluate the designs of a study in several processes, and find the best."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from ..errors import HybridynError
from .common.engine import takes_engine
from .common.figures import plot_option, save_chart
from .common.progress import Progress
from .common.tables import jobs_option, resume_option
from .common.text import aligned_rows, counted

if TYPE_CHECKING:
    from ..studies.sweep.best import Best
    from ..studies.sweep.sweep import Swept

#: Designs of the Pareto front that are printed; the others are counted.
MOST_PRINTED = 50


@click.command(
    "sweep",
    params=[
        plot_option("every measure over every parameter", page=True),
        jobs_option("one per core"),
        resume_option(""),
    ],
    short_help="Evaluate many designs of a robot, and find the best.",
)
@click.argument("study", required=False, metavar="[STUDY]", type=click.Path(dir_okay=False))
@click.option("-o", "--output", metavar="FOLDER", default="results", show_default=True, help="The results.")
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
def command(
    study: str | None,
    output: str,
    jobs: int | None,
    resume: bool,
    allow_python: bool,
    engine: str | None,
    best: str | None,
    where: str | None,
    top: int,
    plot: str | None,
) -> int:
    """Evaluate the designs of STUDY (a TOML file), and find the best.

    A study names a robot, parameters with their values, tasks, and what is measured; docs/sweeps.md explains
    its keys. The results are written to FOLDER, one file (shard) per second of work; a shard is complete or
    does not exist. The rows are the same, bit for bit, for every number of processes. Designs
    that do not load, do not reach a posture or are singular there have a status and a message. Without STUDY,
    --best and --plot use the results of an earlier run:

    hybridyn sweep -o results --best "peak_effort" --where "reach > 0.2"
    """
    if study is None and best is None and plot is None:
        raise click.UsageError("give a STUDY to evaluate, or --best or --plot to ask earlier results")
    if where is not None and best is None and plot is None:
        raise click.UsageError("--where belongs to --best or --plot")
    if study is not None:
        _run(study, output, jobs, resume, allow_python, engine)
    if best is not None:
        from ..studies.sweep.best import find_best

        click.echo("\n".join(_table(find_best(output, best, where, top))))
    if plot is not None:
        from ..figures.sweep import chart_of_sweep

        save_chart(chart_of_sweep(output, where), plot)
    return 0


def _run(
    study: str, output: str, jobs: int | None, resume: bool, allow_python: bool, engine: str | None
) -> None:
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
                study, output, jobs=jobs, resume=resume, allow_python=allow_python,
                compiled=engine != "general", progress=show,
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
        lines.append(f"{state.work / state.now * 1e3:.3g} ms per design, wall time {state.seconds:.2f} s")
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
