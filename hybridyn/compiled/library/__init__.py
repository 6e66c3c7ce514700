"""Build C source into a shared library and call it from Python.

Read `building`, `cache`, `calls` (one sample or a batch; `direct_calls` without ctypes), `laws`
and `steps` (efforts and time steps in C), `current` (the optimised library after a quick build).

May import: `code`, `program`, and what `compiled` may.
"""
