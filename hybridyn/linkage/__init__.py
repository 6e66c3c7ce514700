"""Trees of bodies and their loops, without names: joints, closures, elimination, Newton's method.

Read `joints`, `tree` (its motion), `closures` (rows K and drift), `reduction` (x_dot = Psi u), `newton`
(closing). `elimination` decides ranks; `retraction` moves along joints; `gimbal_lock` serves wrists.

May import: `description` and below.
"""
