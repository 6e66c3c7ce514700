"""Closed-loop quantities of compiled models.

Read `following` (dq/du and its drift in C, and floating robots under a wrench on their base), `engine`
(each quantity from rows of the models), `calls` (the methods of `CompiledRobot`, and the general path
where it is needed).
"""
