"""Build a robot made of modules from a description.

Read `bodies` first, then the files in the order in which a robot is built: `graph` (splits the kinematic
graph into modules), `module_spec` (the numbers of one module, without names), `cut` (the tree after the
cuts), `mechanism` (lengths, ranks and postures, computed once for equal modules), `wrist_motion` (rates of
the cut wrists), `module` (names and indices in q, v and tau), `robot` (the tree of modules), `building`
(runs all steps; `stated` reads home and the joints to keep). `leg_model` computes H, A and D of the legs
with Pinocchio. `state` holds the data of one module that the recursions share.

May import: `linkage`, `tables` and below.
"""
