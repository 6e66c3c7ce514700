"""Chosen numbers of a robot's description as parameters.

Read `slots` (single numbers of a description, and checks of them), `entries` (names of parameters, such as
"mass:upper", and the slots that they set) and `xacro` (arguments of a robot's file).

May import: what `structure` may, and `structure`.
"""
