"""Identification of a robot's dynamic parameters from measured motions, through closed loops.

Read `parameters` (the standard parameters: their names, numbers and order), `regressor` (the rows of
tau = Y values), `base_parameters` (what the efforts depend on), `triangular_factor` (long measurements). Then
`signals` (a log, filtered and differentiated), `rows` (its rows of the linear model), `estimators`, `judging`
(tests of residuals), `consistent` (a robot that can exist), `identify`, `report`; and `excitation`, which
computes the motion to be recorded.

May import: `dynamics`, `compiled`, `streams` and below.
"""
