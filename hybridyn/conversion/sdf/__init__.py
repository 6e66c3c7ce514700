"""Write SDF (Gazebo): loop joints for closures, and the model file beside it.

All is in `sdf`: joints of the tree and closures, then the order of the elements and where the links stand.
"""
