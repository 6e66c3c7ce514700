"""A robot for the solvers of optimal control that people have: over its motors, with its loops closed inside.

Read `closed_model` (a model over the motors with two orders of derivatives), then `casadi_model`, for IPOPT
and whatever else CasADi calls, and `crocoddyl_model`.

May import: `compiled`, `dynamics` and below.
"""
