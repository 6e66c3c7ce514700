"""Scene files: which robot moves how, under which effects, for how long.

Read `scene_file` and `controller_tables` (the keys) and `toml_source` (reading them), `start` (the
assembled start), `stage` (from a file to a simulation), `prescribed` (motors that follow a motion exactly),
`added_controllers` (those of other packages). `controllers` and `references` are functions of time and
state that a program may use as well.

May import: `simulation`, `loading` and below.
"""
