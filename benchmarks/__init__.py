"""Benchmarks: what the models cost, on this machine, after they were found right.

    python -m benchmarks --short     under a minute; results and report in build/benchmarks/
    python -m benchmarks --full      the committed ones: benchmarks/results/, benchmarks/report.md
    python -m benchmarks --report    the report again, from the committed results

Files in the order of use: `cases` (robots and motions), `gate` (are the models right?), `measure` (time and
memory, each point in its own process), `plan` (which points), `results` (CSV), `report` (Markdown from CSV).
"""
