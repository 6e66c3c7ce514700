"""Write SDF (Gazebo): loop joints for closures, and the model file beside it.

Start with `sdf` (the order of the elements), then `posture` (where the links stand), `joints`, `closures`,
`couplings`.
"""
