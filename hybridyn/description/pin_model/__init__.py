"""Read Pinocchio's objects: a `Model` and its constraint models as a `RobotFile`.

Reading order: `numbers` (limits, friction, armature), `joints` (the records of one joint), `constraints`
(closures), `model` (the whole model).
"""
