"""Benchmarks: what accuracy costs in time, for hybridyn and for others, on this machine.

    python -m benchmarks --short            under a minute; results and report in build/benchmarks/
    python -m benchmarks --full             the committed ones: results/, figures/, report.md beside this file
    python -m benchmarks --full --only ddm  some sections; what is done is remembered, `--fresh` forgets
    python -m benchmarks --report           pages and figures again, from the committed results

Files in the order of use: `cases` (robots and motions), `methods` (the one interface of everything that is
compared), `peers/` (one file each), `reference` (answers with their own error), `gate` (are the models
right?), `results` (one row for everything that is measured, CSV), `timing`, `processes`. What is measured:
`accuracy` (models, batches, threads), `scaling`, `flights` with `simulation` and `controlled`,
`derivatives`, `singular`, `effects`, `cold`, `operations`, `callgrind`, `peak`, `closing` and `programs`,
`quantities`, `sweeps`; `plan` (all jobs, and what is remembered). What is said of it: `fronts`, `standing`,
`goals`, `curves` and `figures` (SVG), `tables`, `texts` and `report` (Markdown, from the results alone).
`hard` and `slow` are pages of tests.

Optional: the packages of the extra `bench`, and valgrind (`apt-get install valgrind`) for counting
instructions. What is absent is noted in the results. A full run takes some forty minutes on a quiet machine
with four cores; one that was stopped goes on where it was.

A new method is a file in `peers/` with its `METHODS`, and a name in `peers/__init__.py`.
"""
