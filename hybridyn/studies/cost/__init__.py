"""Accuracy against computing time, for one robot and one motion (`hybridyn cost`).

Read `points` (a measured configuration, and the choice between them), `models` (the inverse model along a
trajectory) and `runs` (the time integration of a scene).

May import: what `studies` may.
"""
