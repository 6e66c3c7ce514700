"""Build C source into a shared library and call it from Python.

Read `compilers`, `building`, `cache`, `trust` (ownership of the cache's files), `calls` (one sample or a
batch), `laws` and `steps` (efforts and time steps in C).

May import: `code`, `program`, and what `compiled` may.
"""
