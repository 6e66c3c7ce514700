"""Read the files beside a URDF: `model.toml` (ours) and `robot.yaml` (Gepetto's models).

Read `companions` (finds the files of a robot, and writes model.toml), `model_toml`, `gepetto`, `hyrodyn`.
`toml_file` and `yaml_file` know the line of each key; `tables` are the keys that are known.

May import: `description`'s own files.
"""
