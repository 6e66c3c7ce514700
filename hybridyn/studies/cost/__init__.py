"""Accuracy against computing time, for one robot and one motion (`hybridyn cost`).

Read `points` (a measured configuration, and the choice between them). Then, of a trajectory, `variants` (what
is measured), `ways`, `reference`, `measured` (one way against the reference) and `spared` (effects); of a
scene, `runs` (what is measured), `solver_settings`, `runner` and `scene_effects`. `compare.methods` sweeps
settings, for benchmarks too.

May import: what `studies` may.
"""
