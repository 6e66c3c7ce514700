"""Build a robot made of modules from a description.

Read `bodies` first (with `Payload`, a body that is added to a link), then the files in the order in which a
robot is built: `graph` (splits the kinematic graph into modules), `wrists` (cuts platforms and wrists free),
`module_spec` (the numbers of one module, without names, and their scales), `cut` (the tree after the cuts,
and the rates of the cut wrists), `mechanism` (lengths, ranks and postures, computed once for equal modules),
`module` (names and indices in q, v and tau, and the state that the recursions share), `robot` (the tree of
modules), `building` (runs all steps). `leg_model` computes H, A and D of the legs with Pinocchio. `samples`
checks arguments of models, `forms` those of effects.

May import: `linkage`, `tables` and below.
"""
