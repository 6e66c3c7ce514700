"""The command line of the benchmarks; see `benchmarks/__init__.py`."""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

from benchmarks.cases import ROOT
from benchmarks.gate import WrongModelError
from benchmarks.plan import FULL, SHORT, run
from benchmarks.report import report
from benchmarks.results import machine, read_machine, read_results, write_machine, write_results
from benchmarks.slow import run_slow

COMMITTED = ROOT / "benchmarks"
SCRATCH = ROOT / "build" / "benchmarks"


def write_report(folder: Path) -> Path:
    """Write the report from the results in a folder."""
    results = folder / "results"
    path = folder / "report.md"
    path.write_text(report(read_results(results / "results.csv"), read_machine(results / "machine.csv")))
    return path


def main() -> int:
    """Run what the command line asks for; gives the exit status."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description="What the models cost.")
    group = parser.add_mutually_exclusive_group(required=True)
    group.add_argument("--short", action="store_true", help="under a minute, into build/benchmarks/")
    group.add_argument("--full", action="store_true", help="minutes, into benchmarks/")
    group.add_argument("--report", action="store_true", help="only the report, from the committed results")
    group.add_argument("--slow", action="store_true", help="the slow tests, into benchmarks/results/slow.csv")
    options = parser.parse_args()
    if options.slow:
        return run_slow(COMMITTED / "results" / "slow.csv")
    if options.report:
        print(write_report(COMMITTED))
        return 0
    folder, plan = (SCRATCH, SHORT) if options.short else (COMMITTED, FULL)
    (folder / "results").mkdir(parents=True, exist_ok=True)
    started, facts, results = time.perf_counter(), machine(), []
    try:
        for result in run(plan):
            results.append(result)
            case, parameter, at, quantity, value, unit = result
            print(f"{case}, {at} {parameter}: {quantity} {value:.4g} {unit}", flush=True)
    except WrongModelError as error:
        print(f"wrong: {error}", file=sys.stderr)
        return 1
    write_results(folder / "results" / "results.csv", results)
    write_machine(folder / "results" / "machine.csv", facts)
    print(f"{write_report(folder)} after {time.perf_counter() - started:.0f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
