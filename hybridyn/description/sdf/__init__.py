"""Read SDFormat, the robot and world files of Gazebo, into plain records.

Start with `sdf` (the order of the steps), then `elements` (what is read, noted and refused; numbers),
`models` (which model is the robot, included files, names, and where everything stands), and `stated` (links
and joints as the file states them). `description.joint_graph` makes a tree of them.
"""
