"""What commands share: the robot's options, the engine, progress, summaries, tables.

Read `options`, `tables` (a command from table to table), `engine`, `summary`.

May import: what `cli` may.
"""
