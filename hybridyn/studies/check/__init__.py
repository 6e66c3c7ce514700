"""Checks of a robot's files. Each finding names its line and how to mend it (`hybridyn.check`).

Read `finding`, `subject` (the data that is checked) and `check` (runs every check) first. Each other file
holds the checks of one topic; `remarks` says what looks wrong in a robot that was built.

May import: what `studies` may.
"""
