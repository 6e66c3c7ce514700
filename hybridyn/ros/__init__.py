"""Robots with loops in ROS 2: complete states, trajectories of motors, efforts, diagnostics.

Read `joint_numbers` (what messages hold of joints), `ros_model` (closing and efforts, compiled where it can
be), `complete_states`, `turned_trajectories`, `health`: none of them imports ROS. `node` connects them to
topics, `settings` has what the node is told.

May import: `compiled`, `conversion`, `simulation`, `streams` and below.
"""
