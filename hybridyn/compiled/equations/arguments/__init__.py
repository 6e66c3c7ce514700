"""Numbers of a robot that are arguments of its models instead of constants.

Read `module_arguments` (the arguments of one module's code), `chosen` (numbers of the description that are
arguments, and the modules' numbers as functions of them), `traced` (numbers that remember how
they follow from parameters), `numbers_of` (traced numbers as expressions),
`coefficients` (those of joint laws) and `structure_guard` (samples whose arguments give another structure).

May import: `expressions`, `guards` and what `equations` may.
"""
