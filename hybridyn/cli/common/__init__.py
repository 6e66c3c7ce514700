"""Code that commands share: the options of the robot, files, the engine, progress, tables.

`options`, `files` and the options of `figures` are what `words` is made of: they import nothing large. Then
read `tables` (a command from table to table, and the observers of its pass), `batch` (the same for many
tables), `engine`. `reports` and `maps` are what `idm` says beside efforts.

May import: the same as `cli`.
"""
