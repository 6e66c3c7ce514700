"""Code that commands share: the options of the robot, files, the engine, progress, tables.

`options`, `files` and the options of `figures` are what `words` is made of: they import nothing large. Then
read `one_table` (the files of a command from table to table), `batch` (the same for many tables),
`each_table` (which of the two), `table_pass` and `summary` (what is computed, and what is told), and
`engine_choice`. `reports` and `maps` are what `idm` says beside efforts.

May import: the same as `cli`.
"""
