"""Sweeps: evaluate many designs of a robot on tasks, in several processes, and find the best.

Read `study_file` and `reading` (the study), `designs` (values of the parameters), `variants` (the robot of a
design), `measures` (what is measured), `evaluation` (designs to rows), `shards` (rows on disk), `sweep` (all
of it), `expressions` and `best` (questions).
"""
