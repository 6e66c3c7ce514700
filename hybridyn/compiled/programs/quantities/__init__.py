"""Closed-loop quantities of compiled models.

Read `following` (dq/du and its drift in C), `rows` (rows of the models that make up each quantity),
`held_base` (the same for floating robots), `calls` and `link_calls` (the methods of `CompiledRobot`, and the
general path where it is needed).
"""
