"""Write SDF (Gazebo): loop joints for closures, and the model file beside it.

Start with `sdf` (the order of the elements, where the links stand), then `joints` (joints of the tree and
closures).
"""
