"""Workspace of a module: the poses that its platform can reach from home.

Read `sweep` (the coordinates), `measures` (conditioning and efforts of a posture) and `workspace` (steps
between poses, all of them, and the public function).

May import: what `studies` may.
"""
