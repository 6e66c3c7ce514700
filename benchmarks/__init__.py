"""Benchmarks: what accuracy costs in time, for hybridyn and for others, on this machine.

    python -m benchmarks --short            under a minute; results and report in build/benchmarks/
    python -m benchmarks --full             the committed ones: results/, figures/, report.md beside this file
    python -m benchmarks --full --only ddm  some sections; what is done is remembered, `--fresh` forgets
    python -m benchmarks --report           pages and figures again, from the committed results

Files in the order of use: `cases` (robots and motions), `peers/` (everything that is compared; the engines
are those of `hybridyn compare`), `reference` (answers with their own error; are the models right?),
`results` (one row for everything that is measured, CSV), `timing` (calls and processes). What is measured:
`accuracy` (models, batches, threads, cold calls), `scaling`, `flights` with `simulation`, `derivatives`,
`singular`, `studies` (effects, sweeps), `losses`, `searches`, `shooting` (by `ddp`), `operations`,
`callgrind`, `closing` and `programs`, `quantities`; `plan` (all jobs, and what is remembered). What is
said of it: `fronts`, `goals`, `descents`, `figures` (SVG, by `panels`), `texts` and `report` (Markdown, from
the results alone).
`hard` has pages of tests.

`python -m benchmarks.batches` measures batches on a GPU, `python -m benchmarks.identification` identification
beside figaroh, each by itself.

Optional: the packages of the extra `bench`, and valgrind (`apt-get install valgrind`) for counting
instructions. What is absent is noted in the results. A full run takes some forty minutes on a quiet machine
with four cores; one that was stopped goes on where it was.

A new method is one of the `METHODS` of an engine in `hybridyn/studies/compare/engines/`.
"""
