"""Read Pinocchio's objects: a `Model` and its constraint models as a `RobotFile`.

Read `model` (joints, then the whole model), then `constraints` (what is checked, and closures).
"""
