"""Read SDFormat, the robot and world files of Gazebo, into plain records.

Start with `sdf` (the order of the steps), then `schema` (which elements exist), `fields` (texts and numbers
of elements), `library` (included files), `world` (which model is the robot), `models` (names, and where
everything stands), `links`, and `joints` (as the file states them). `description.joint_graph` makes a tree
of them.
"""
