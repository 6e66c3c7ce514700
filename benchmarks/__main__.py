"""The command line of the benchmarks; see `benchmarks/__init__.py`."""

from __future__ import annotations

import argparse
import shutil
import sys
import time
from pathlib import Path

from benchmarks.cases import ROOT
from benchmarks.hard import run_hard, run_slow, write_page
from benchmarks.history import changes
from benchmarks.plan import CACHE, Cache, Task, fingerprint, full, measured, short
from benchmarks.report import read_results, write_report
from benchmarks.results import SECTIONS, Row, read_machines, write_machines, write_rows
from benchmarks.timing import one_thread

COMMITTED = ROOT / "benchmarks"
SCRATCH = ROOT / "build" / "benchmarks"

Collected = dict[str, tuple[list[Row], dict[str, str]]]


def main() -> int:
    """Run what the command line asks for; gives the exit status."""
    options = _options()
    if options.hard:
        return run_hard(COMMITTED)
    if options.slow:
        return run_slow(COMMITTED / "results" / "slow.csv")
    if options.report:
        write_page(COMMITTED)
        print(write_report(COMMITTED))
        return 0
    if options.compare:
        print("\n".join(changes(read_results(SCRATCH / "results"), read_results(COMMITTED / "results"))))
        return 0
    folder, tasks = (SCRATCH, short()) if options.short else (COMMITTED, full())
    if options.short:
        shutil.rmtree(SCRATCH / "results", ignore_errors=True)
    wanted = set(options.only or SECTIONS)
    tasks = [task for task in tasks if task.section in wanted]
    cache = None if options.short else Cache(CACHE, fingerprint())
    if cache is not None and options.fresh:
        cache.forget(tasks)
    one_thread()
    started = time.perf_counter()
    collected, failed = collect(tasks, cache)
    store(folder / "results", collected)
    print(f"{write_report(folder)} after {time.perf_counter() - started:.0f} s")
    for line in failed:
        print(line, file=sys.stderr)
    return 1 if failed else 0


def collect(tasks: list[Task], cache: Cache | None) -> tuple[Collected, list[str]]:
    """Measure jobs, all that can be.

    Returns:
        Rows and machine of each section, those left out of which a job failed; what failed, in words.
    """
    out: Collected = {}
    failed: dict[str, str] = {}
    for number, task in enumerate(tasks, 1):
        started = time.perf_counter()
        try:
            rows, facts, remembered = measured(task, cache)
        except Exception as error:  # the others are worth having; a run takes long
            notes = "".join(getattr(error, "__notes__", []))
            failed[task.section] = f"failed: {task.section}, {task.name}: {error}\n{notes}"
            print(failed[task.section], flush=True)
            continue
        how = "from the cache" if remembered else f"{time.perf_counter() - started:.1f} s"
        without = sum(bool(row.note) for row in rows)
        said = f"{len(rows)} rows, {without} not measured" if without else f"{len(rows)} rows"
        print(f"[{number}/{len(tasks)}] {task.section}, {task.name}: {said}, {how}", flush=True)
        out.setdefault(task.section, ([], facts))[0].extend(rows)
    return {name: found for name, found in out.items() if name not in failed}, list(failed.values())


def store(folder: Path, collected: Collected) -> None:
    """Write the files of the sections that were measured; the others stay."""
    machines = read_machines(folder / "machine.csv")
    for section, (rows, facts) in collected.items():
        machines[section] = facts
        write_rows(folder / f"{section}.csv", rows)
    write_machines(folder / "machine.csv", {name: machines[name] for name in SECTIONS if name in machines})


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description="What the models cost.")
    group = parser.add_mutually_exclusive_group(required=True)
    group.add_argument("--short", action="store_true", help="under a minute, into build/benchmarks/")
    group.add_argument("--full", action="store_true", help="tens of minutes, into benchmarks/")
    group.add_argument("--report", action="store_true", help="only the pages, from the committed results")
    group.add_argument("--compare", action="store_true", help="the last short run with the committed rows")
    group.add_argument("--hard", action="store_true", help="the hard cases, into benchmarks/hard.md")
    group.add_argument("--slow", action="store_true", help="the slow tests, into benchmarks/results/slow.csv")
    parser.add_argument("--only", nargs="+", choices=list(SECTIONS), help="these sections")
    parser.add_argument("--fresh", action="store_true", help="measure everything again")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
