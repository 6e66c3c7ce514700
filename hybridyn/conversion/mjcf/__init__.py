"""Write MJCF, for MuJoCo.

Start with `mjcf` (the order of the elements), then `parts` (joints and closures that MuJoCo has no word for),
`bodies` (links and joints, their numbers, motors and shapes).
"""
