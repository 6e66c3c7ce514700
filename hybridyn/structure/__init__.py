"""From a description to a robot made of modules.

Read `bodies`, then, in the order in which a robot is built: `graph` (modules cut from the kinematic graph),
`module_spec` (a module's numbers, without names), `cut` (the tree after the cuts),
`mechanism` (what is solved once for equal modules), `wrist_motion` (rates of the wrists that were cut),
`module` (named, placed in q, v and tau), `robot` (the tree of modules), `building` (all of it together).
`leg_model` is Pinocchio's part: H, A and D of the legs. `state` is what the recursions hand on.

May import: `linkage`, `tables` and below.
"""
