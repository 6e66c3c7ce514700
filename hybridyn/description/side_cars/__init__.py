"""Read the files beside a URDF: `model.toml` (ours) and `robot.yaml` (Gepetto's models).

Read `companions` (finds the files of a robot), `model_toml`, `gepetto`. `toml_file` and `yaml_file` know the
line of each key; `schema` turns pydantic's errors into one line.

May import: `description`'s own files.
"""
