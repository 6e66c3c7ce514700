"""C text to a library that Python calls.

Read `compilers`, `building`, `cache`, `trust` (whose files they are), `calls` (one sample or a batch),
`steps` (time steps in C).

May import: `code`, `program`, and what `compiled` may.
"""
