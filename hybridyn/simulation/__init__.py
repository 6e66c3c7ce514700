"""Time integration on the manifold of assembled postures.

Read `simulate` (`hybridyn.simulate`), `solver` (its options), `system` (what is integrated), the methods
`explicit`, `implicit` and `conserving`, `stepping` (how long steps are), `run` (the loop), `events`,
`dense_output`, `result`.

May import: `compiled`, `dynamics`, `manifold` and below.
"""
