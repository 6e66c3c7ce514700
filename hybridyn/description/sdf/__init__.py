"""Read SDFormat, the robot and world files of Gazebo, into plain records.

Start with `sdf` (the order of the steps), then `schema` (which elements exist), `fields` (texts and numbers
of elements), `library` (included files), `scopes` (models and the names in them), `poses` (where everything
stands), `links`, `axes` and `joints` (as the file states
them), `graph` (which joints close loops), `chains`
(joints as one-axis joints), `loops`, `couplings`.
"""
