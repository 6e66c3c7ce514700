"""What is wrong with a robot, each finding with its line and its mend (`hybridyn.check`).

Read `finding`, `subject` (what is checked), `check` (all of it); every other file is one kind of finding.

May import: what `studies` may.
"""
