"""Numbers of a robot that are arguments of its models instead of constants.

Read `traced` (numbers that remember how they follow from parameters), `module_arguments` (numbers that are
arguments, and the modules' numbers as functions of them) and `coefficients` (those of joint laws).

May import: `expressions`, `rigid` and what `equations` may.
"""
