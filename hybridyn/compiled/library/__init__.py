"""Build C source into a shared library and call it from Python.

Read `compilers`, `building`, `cache`, `calls` (one sample or a batch; `direct_calls` without ctypes), `laws`
and `steps` (efforts and time steps in C), `current` and `replacing` (the optimised library after a quick
build).

May import: `code`, `program`, and what `compiled` may.
"""
