"""Gradients over the parameters of a robot, through its closed loops.

While a parameter changes, some coordinates stay (`kept`), and all others follow such that the loops stay
closed. Read `slot_changes` (how the numbers of the description follow parameters), `kept`, `samples`,
`blocks` (the rows of loops, factored), `adjoint` (back through closed loops: the work does not depend on the
number of parameters), `model_sweeps`, `over_parameters`, `alike` (for which designs programs hold) and
`gradient` (what is given and returned), then `design_gradients` (`hybridyn.DesignGradients`).

May import: `compiled`, `dynamics`, `assembly` and below.
"""
