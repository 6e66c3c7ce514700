"""Inverse and direct dynamic models of Ibrahim & Khalil (2010), with checks of their results.

Read `forward` (Eqs. (25), (28)), `inverse_recursion` (Eqs. (30)-(33)), `backward` (its checks, efforts and
reactions), `inverse` (`hybridyn.idm`), `direct_recursion` (Eqs. (38)-(53)), `direct` (`hybridyn.ddm`, and
joints without a motor). `motor_currents` says what DC motors take from their supply. `loads` collects the
wrenches and effects that act on the robot. `actuation`
distributes efforts among motors. `joint_wrenches` and `reactions` compute what joints and closures transmit.
Friction that grows with it is solved by `load_friction`, with `friction_of_motion` and, in the direct model,
`friction_response` (how wrenches answer to friction) and `friction_bound` (how much frictions feed on one
another); `stiction`, `holding` and `cones` are for joints that stick. `guards` is the table of what is
refused or warned of. `state_checks` refuses states with open loops. `inertia_solve` factors A_t, and
`rounding` bounds what rounding feigns in it. The folder `quantities` has the model in independent
coordinates.

May import: `effects`, `manifold`, `structure` and below.
"""
