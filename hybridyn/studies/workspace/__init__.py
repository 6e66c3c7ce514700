"""Workspace of a module: the poses that its platform can reach from home.

Read `sweep` (the coordinates), `flood` (steps between poses, and all of them), `measures` (conditioning and
efforts of a posture) and `workspace` (the public function).

May import: what `studies` may.
"""
