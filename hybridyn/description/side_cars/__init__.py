"""Read the files beside a URDF: `model.toml` (ours) and `robot.yaml` (Gepetto's models).

Read `beside` (finds the files of a robot), `model_toml` (reads and writes model.toml), `gepetto`, `hyrodyn`,
`hyrodyn_types`.
`toml_file` and `yaml_file` know the line of each key; `tables` are the keys that are known, and
`problems` tells what is wrong with a file's values.

May import: `description`'s own files.
"""
