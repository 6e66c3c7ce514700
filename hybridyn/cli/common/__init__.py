"""Code that commands share: the options of the robot, the engine, progress, summaries, tables.

Read `options`, `tables` (a command from table to table), `engine`, `summary`.

May import: the same as `cli`.
"""
