"""Programs to C text. Nothing here knows of robots.

Read `graph` (operations), `fusing`, `kernels` (C of one kernel), `scalars` (what a number is), `rules`
(what a program must keep to), the drivers `across_samples` and `across_copies`, then `library_source` and
`plain_c`. `c/` holds the headers.

May import: `program`, `spatial`, `errors`.
"""
