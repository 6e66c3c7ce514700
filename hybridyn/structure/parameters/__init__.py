"""Chosen numbers of a robot's description as parameters.

Read `slots` (single numbers of a description), `checks`, `entries` (names of parameters, such as
"mass:upper", and the slots that they set), `traced` (numbers that remember how they follow from the
parameters) and `expressed` (the numbers of a robot's modules as functions of the parameters).

May import: what `structure` may, and `structure`.
"""
