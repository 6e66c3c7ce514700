"""`hybridyn sweep`: evaluate the designs of a study in several processes, and find the best."""

from typing import Any

import click

from ..errors import HybridynError
from ..figures.sweep import chart_of_sweep
from ..studies.sweep.best import Best, find_best
from ..studies.sweep.sweep import Swept
from ..studies.sweep.sweep import sweep as sweep_study
from .common.executors import Asked, processes
from .common.figures import save
from .common.options import refuse
from .common.progress import progress
from .common.text import aligned_rows, counted

#: Designs of the Pareto front that are printed; the others are counted.
MOST_PRINTED = 50


def run(
    study: str | None,
    output: str,
    jobs: int | None,
    executor: str | None,
    dask: str | None,
    resume: bool,
    allow_python: bool,
    engine: str | None,
    gradient: bool,
    best: str | None,
    where: str | None,
    top: int,
    plot: str | None,
    strict: bool,
) -> None:
    """Evaluate a study, and tell or draw the results."""
    asked = best or plot
    refuse(
        (not study and not asked, "give a STUDY to evaluate, or --best or --plot to ask earlier results"),
        (not study and (executor or dask), "--executor and --dask belong to a STUDY"),
        (not study and gradient, "--gradient belongs to a STUDY"),
        (gradient and engine == "compiled", "--gradient goes without --engine compiled"),
        (where and not asked, "--where belongs to --best or --plot"),
    )
    if study is not None:
        with processes(Asked(jobs, executor, dask)) as (count, start):
            _evaluate(
                study, output, engine, jobs=count, executor=start, resume=resume, allow_python=allow_python,
                gradient=gradient, strict=strict,
            )  # fmt: skip
    if best is not None:
        click.echo("\n".join(_table(find_best(output, best, where, top))))
    if plot is not None:
        save(chart_of_sweep(output, where), plot)


def _evaluate(study: str, output: str, engine: str | None, **options: Any) -> None:
    """Evaluate a study, and print what became of its designs; the options are those of `sweep`."""
    states: list[Swept] = []
    try:
        with progress("designs") as draw:

            def show(state: Swept) -> None:
                """Keep the state of the sweep, and show it."""
                states[:] = [state]
                draw(state.now, state.now / (state.designs - state.done + state.now))

            state = sweep_study(study, output, compiled=engine != "general", progress=show, **options)
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
        lines += [
            f"by compiled models: {state.compiled:,}",
            f"compared with robots built for their designs: {state.checked:,}, largest difference "
            f"{state.difference:.1e}",
        ]
    elif state.now:
        why = "as asked" if engine == "general" else "compiling takes longer than these designs"
        lines.append(f"by the general path, without compiled models: {state.why_general or why}")
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
