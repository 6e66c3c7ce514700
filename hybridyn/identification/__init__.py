"""Identification of a robot's dynamic parameters from measured motions, through closed loops.

Read `parameters` (the standard parameters: their names, numbers and order), `regressor` (the rows of
tau = Y values), `base_parameters` (what the efforts depend on), `triangular_factor` (long measurements).

May import: `dynamics`, `compiled`, `streams` and below.
"""
