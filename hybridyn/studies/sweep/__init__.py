"""Sweeps: evaluate many designs of a robot on tasks, in several processes, and find the best.

Read `study_file` and `reading` (the study), `designs` (values of the parameters), `stated_numbers` and
`variants` (the robot of a design), `measures` (what is measured; `motion_columns`, `python_measures` and
`added_measures` are three kinds), `following` and `playing` (along a trajectory, in a scene), `evaluation`
(designs to rows), `shards` (rows on disk), `sweep` (all of it), `expressions` and `best` (questions).
Measures with gradients: `measure_bars`, `gradients`, `gradient_chunks`. With compiled models: `slot_numbers`,
`many_designs`, `compiled_designs`, `compiled_chunks`.
"""
