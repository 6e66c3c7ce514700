"""The poses that a module's platform can reach from home.

Read `sweep` (coordinates), `steps` (one step), `flood` (all of them), `measures`, `workspace`.

May import: what `studies` may.
"""
