"""Trees of bodies and their loop closures, by index: joints, closures, elimination, Newton's method.

Read `joints`, `tree` (its motion), `closure_rows` (residual, rows and drift of a form of closure), `closures`
(those of a tree, K and gamma), `reduction` (x_dot = Psi u), `loop_problem` and `newton` (loop closing),
`walking` and `generic_postures` (where ranks are determined). `elimination` factors matrices by QR;
`retraction` applies joint displacements; `targets` are poses that are given.

May import: `description` and below.
"""
