"""Accuracy against computing time, for one robot and one motion (`hybridyn cost`).

Read `points` (a measured configuration, and the choice between them), `quantities` (what is computed along a
trajectory, in which ways), `models` (its measurement) with `stages` (effects and rates), and `runs` (the time
integration of a scene) with `settings` and `runner`. `compare.methods` sweeps settings, for benchmarks too.

May import: what `studies` may.
"""
