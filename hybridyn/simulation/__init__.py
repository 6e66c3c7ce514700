"""Time integration on the manifold of assembled postures.

Read `simulate` (`hybridyn.simulate`), `system` (what is integrated), the methods `runge_kutta` and
`conserving`, `solver` (options), `stepping` (how long steps are), `run` (the loop), `events` (what is between
the ends of steps), `sticking` (joints that stick), `result`.

May import: `compiled`, `dynamics`, `manifold` and below.
"""
