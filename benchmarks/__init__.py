"""Benchmarks: what accuracy costs in time, for hybridyn and for others, on this machine.

    python -m benchmarks --short            under a minute; results and report in build/benchmarks/
    python -m benchmarks --full             the committed ones: results/, figures/, report.md beside this file
    python -m benchmarks --full --only ddm  some sections; what is done is remembered, `--fresh` forgets
    python -m benchmarks --report           report and figures again, from the committed results
    python -m benchmarks.closing            loops closed in C: control steps, rows of tables; prints a table

Files in the order of use: `cases` (robots and motions), `methods` (the one interface of everything that
is compared), `peers/` (one file each), `reference` (answers with their own error), `gate` (are the models
right?), `timing`, `processes`; the sections `accuracy`, `scaling`, `simulation`, `throughput`,
`singular`, `callgrind`, `job`; `plan` (what is measured, and what is remembered), `results` (CSV),
`fronts`, `standing` and `goals` (what they say), `curves` and `figures` (SVG), `tables`, `texts` and `report`
(Markdown, from the results alone).

Optional: the packages of the extra `bench`, and valgrind (`apt-get install valgrind`) for counting
instructions. What is absent is reported as not measured. A full run takes some forty minutes on a quiet
machine with four cores; one that was stopped goes on where it was.

A new method is a file in `peers/` with its `METHODS`, and a line in `peers/__init__.py`.
"""
