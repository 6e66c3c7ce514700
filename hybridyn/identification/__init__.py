"""Identification of a robot's dynamic parameters from measured motions, through closed loops.

Read `inertial` (the ten numbers of a body, and those of one that can exist) and `parameters` (the standard
parameters: names, numbers, order; those that equal legs share), `regressor` (the rows of tau = Y values),
`base_parameters` (what the efforts depend on; long measurements), `grouping` (the same count by Khalil's
rules), `compiled_rows` (the rows in C). Then `signals` (a log, filtered and differentiated), `rows` (its rows
of the linear model), `identify` (estimators, and a robot that can exist), `result` (tests of residuals, the
report); and `excitation`, which computes the motion to be recorded.

May import: `dynamics`, `compiled`, `streams` and below.
"""
