"""Read SDFormat, the robot and world files of Gazebo, into plain records.

Start with `sdf` (links and joints as the file states them, and the order of the steps), then `elements` (what
is read, noted and refused; numbers) and `models` (which model is the robot, included files, names, and where
everything stands). `description.joint_graph` makes a tree of links and joints.
"""
