"""Studies of a robot: model checks, motor sizing, workspaces, physical effects, and accuracy against time.

`check/` checks a model. `sizing` computes the load of each motor, `bearings` that of each joint.
`workspace/` sweeps the poses that a module reaches. `effect_worth` evaluates each physical effect.
`map_table` writes the map between motors and output joints in columns, `actuators` the motors as seen
there. `assemblies` finds all postures, `home` those of the motors at home; `branch` names a robot's assembly
branch. `cost/` measures error against computing time. `sweep/` evaluates many designs of a robot. What
computes much, there and for many tables, shares `pools` (other processes), `far_processes` (those that
another program started) and `results_folder` (results that can be continued).

May import: `scenes`, `compiled` and below.
"""
