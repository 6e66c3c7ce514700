"""Accuracy against computing time, for one robot and one motion (`hybridyn cost`).

Read `points` (a measured configuration, and the choice between them), `models` (what is computed along a
trajectory, in which ways), and `runs` (the time integration of a scene). `compare.methods` sweeps settings,
for benchmarks too.

May import: what `studies` may.
"""
