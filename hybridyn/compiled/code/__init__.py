"""Generate C source from programs. Nothing here depends on robots.

Read `graph` (operations), `kernels` (C of one kernel), `scalars` (number types), `rules` (checks of a
program, and its memory), `drivers` (calls of kernels), then `library_source` and `plain_c`. `c/` holds the
headers.

May import: `program`, `spatial`, `errors`.
"""
