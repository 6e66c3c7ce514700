"""Chosen numbers of a robot's description as parameters.

Read `effect_numbers` (which numbers of effects may be parameters), `slots` (single numbers of a description,
and checks of them), `entries` (names of parameters, such as "mass:upper", and the slots that they set),
`xacro` (arguments of a robot's file), `chosen` (the parameters of a model) and `shares` (what designs of one
model have in common beside).

May import: what `structure` may, and `structure`.
"""
