"""Chosen numbers of a robot's description as parameters.

Read `slots` (single numbers of a description, and checks of them), `entries` (names of parameters, such as
"mass:upper", and the slots that they set), `xacro` (arguments of a robot's file) and `shares` (what
designs of one model have in common beside).

May import: what `structure` may, and `structure`.
"""
