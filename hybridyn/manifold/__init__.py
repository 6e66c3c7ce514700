"""The manifold of assembled postures: independent coordinates for time integration.

Read `loop_rows` (closures of one module at one posture), `branch` (where closures lose rank),
`module_chart`, `manifold` (its charts).

May import: `structure` and below.
"""
