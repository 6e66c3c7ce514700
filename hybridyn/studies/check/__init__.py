"""Checks of a robot's files. Each finding names its line and how to mend it (`hybridyn.check`).

Read `finding`, `shapes` and `subject` (the data that is checked) and `check` (runs every check) first. Each
other file holds the checks of one topic; `reader_said` passes on what readers found; `remarks` says what
looks wrong in a robot that was built.

May import: what `studies` may.
"""
