"""What accuracy costs in time, for one robot and one motion (`hybridyn cost`).

Read `points` (a measured configuration, and those worth having), `models` (the inverse model along a
trajectory), `runs` (the integration of a scene).

May import: what `studies` may.
"""
