"""Accuracy against computing time, for one robot and one motion (`hybridyn cost`).

Read `points` (a measured configuration, and the choice between them), `quantities` (what is computed along a
trajectory, in which ways), `models` (its measurement) with `effect_sets` and `rates`, and `runs` (the time
integration of a scene) with `settings`.

May import: what `studies` may.
"""
