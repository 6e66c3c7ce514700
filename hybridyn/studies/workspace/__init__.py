"""Workspace of a module: the poses that its platform can reach from home.

Read `sweep` (the coordinates), `steps` (one step between poses), `flood` (all steps), `measures`
(conditioning and efforts of a posture) and `workspace` (the public function).

May import: what `studies` may.
"""
