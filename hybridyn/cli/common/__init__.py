"""Code that commands share: the options of the robot, the engine, progress, summaries, tables.

Read `options`, `tables` (a command from table to table, and the observers of its pass), `engine`, `summary`.
`reports` and `maps` are what `idm` says beside efforts; `tree` is the tree that `info` shows.

May import: the same as `cli`.
"""
