"""Identification of a robot's dynamic parameters from measured motions, through closed loops.

Read `inertial` (the ten numbers of a body), `standard` and `parameters` (the standard parameters: names,
numbers, order), `equal_legs` (those that equal legs share), `robot_with` (the robot that has others),
`regressor` (the rows of tau = Y values), `whitening` (rows of like noise, also of redundant motors),
`base_parameters` (what the efforts depend on), `long_measurements` (reduced to one factor), `vectors` and
`grouping` (the same count by Khalil's rules), `compiled_rows` (the rows in C). Then `series` and `logs` (what
was recorded, and when), `signals` (filtered and differentiated), `sought` (what is sought, and what is held),
`rows` (the log's rows of the linear model), `units` (of the log), `estimators`, `losses` (what losses that
grow with load add to the linear model), `loss_fit` (their estimate, and whether the motion tells them),
`possible` (numbers of a robot that can exist), `identify` (all of this), `result` (tests of residuals, the
report); and `excitation`, which computes the motion to be recorded.

May import: `dynamics`, `compiled`, `streams` and below.
"""
