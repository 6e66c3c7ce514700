"""Scene files: which robot moves how, under which effects, for how long.

Read `scene_tables` (the keys), `toml_source` and `scene_file` (reading them), `stage` (from a file to a
simulation). `controllers` and `references` are functions of time and state that a program may use as well.

May import: `simulation`, `loading` and below.
"""
