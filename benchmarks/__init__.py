"""Benchmarks: what accuracy costs in time, for hybridyn and for others, on this machine.

    python -m benchmarks --short            under a minute; results and report in build/benchmarks/
    python -m benchmarks --full             the committed ones: results/, figures/, report.md beside this file
    python -m benchmarks --full --only ddm  some sections; what is done is remembered, `--fresh` forgets
    python -m benchmarks --report           report and figures again, from the committed results

Files in the order of use: `cases` (robots and motions), `methods` (the one interface of everything that
is compared), `peers/` (one file each), `reference` (answers with their own error), `gate` (are the models
right?), `timing`, `processes`; the sections `accuracy`, `scaling`, `simulation`, `throughput`,
`singular`, `callgrind`, `job`; `plan` (what is measured, and what is remembered), `results` (CSV),
`fronts` and `goals` (what they say), `curves` and `figures` (SVG), `texts` and `report` (Markdown, from
the results alone).

A new method is a file in `peers/` with its `METHODS`, and a line in `peers/__init__.py`.
"""
