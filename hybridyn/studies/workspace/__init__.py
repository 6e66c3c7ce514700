"""Workspace of a link: the poses that it can reach from home.

Read `link_sweep` (the coordinates), `measures` (conditioning and efforts of a posture), `closing` (steps
between poses), `flood` (the search) and `workspace` (all poses, and the public function).

May import: what `studies` may.
"""
