"""Sweeps: evaluate many designs of a robot on tasks, in several processes, and find the best.

Read `study_tables` and `study_file` (the study), `designs` (values of the parameters), `variants` (the robot
of a design), `following` (a trajectory), `measures` (what is measured), `evaluation` (designs to rows),
`shards` (rows on disk), `engines` and `dask_pool` (other processes), `sweep` (all of it), `expressions` and
`best` (questions).
"""
