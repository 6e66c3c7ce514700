"""Closed-loop quantities of compiled models.

Read `engine` (dq/du and its drift in C, floating robots under a wrench on their base, each quantity from
rows of the models), `calls` (the methods that `CompiledRobot` offers, and the general path where it is
needed).
"""
