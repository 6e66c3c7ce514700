"""Write one module's equations as CasADi expressions, cut into stages.

Read `request` (robot, effects, and `arguments` in place of numbers), `parts` (core, groups of equal legs),
`idle` (motions that nothing drives or feels), `own_axes` (axes along rods), `chains` and `legs` (appendices A
to C), `core`, `guarded_elimination` (pivots chosen once, and guards, which detect samples that need the
general path), `inverse` and `direct` (the models), `balance` (what their derivatives follow from), `stages`
(the graph and its cuts).

May import: `program`, and what `compiled` may.
"""
