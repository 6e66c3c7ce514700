"""Identification of a robot's dynamic parameters from measured motions, through closed loops.

Read `inertial` and `parameters` (the standard parameters: names, numbers, order), `equal_legs`, `regressor`
(the rows of tau = Y values), `base_parameters` (what the efforts depend on), `grouping` (the same count by
Khalil's rules), `compiled_rows` (the rows in C), `triangular_factor` (long measurements). Then `signals` (a
log, filtered and differentiated), `rows` (its rows of the linear model), `estimators`, `judging` (tests of
residuals), `consistent` (a robot that can exist), `identify`, `report`; and `excitation`, which computes the
motion to be recorded.

May import: `dynamics`, `compiled`, `streams` and below.
"""
