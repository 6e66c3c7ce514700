"""The inverse and the direct dynamic model of Ibrahim & Khalil (2010), and their guards.

Read `forward` (Eqs. (25), (28)), `inverse_recursion` (Eqs. (30)-(33)), `backward` (its sweep over modules),
`inverse` (`hybridyn.idm`), `articulation` (Eqs. (38)-(53)), `direct` (`hybridyn.ddm`), `passive` (joints
without a motor). `loads` gathers what acts on the robot; `actuation` shares efforts among motors;
`inverse_guards`, `lost_rank`, `lost_digits` and `massless` refuse what cannot be computed.

May import: `effects`, `manifold`, `structure` and below.
"""
