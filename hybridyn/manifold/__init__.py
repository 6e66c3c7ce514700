"""Assembled postures as a manifold: independent coordinates in which time integration steps.

Read `loop_rows` (closures of one module at one posture), `branch` (where closures lose rank), `chart`,
`manifold`.

May import: `structure` and below.
"""
