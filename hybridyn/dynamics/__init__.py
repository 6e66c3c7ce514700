"""Inverse and direct dynamic models of Ibrahim & Khalil (2010), with checks of their results.

Read `forward` (Eqs. (25), (28)), `inverse_recursion` (Eqs. (30)-(33)), `backward` (its sweep over modules),
`inverse` (`hybridyn.idm`), `articulation` (Eqs. (38)-(53)), `direct` (`hybridyn.ddm`), `passive` (joints
without a motor). `loads` collects the wrenches and effects that act on the robot. `actuation` distributes
efforts among motors. `inverse_guards`, `lost_rank`, `lost_digits` and `massless` raise errors or warn at
samples without a meaningful result; `inertia_rounding` bounds what rounding feigns. The folder `quantities`
has the model in independent coordinates.

May import: `effects`, `manifold`, `structure` and below.
"""
