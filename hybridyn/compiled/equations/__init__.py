"""One module's equations in CasADi expressions, cut into stages.

Read `request` (what is asked for), `parts` (core and groups of equal legs), `chains` and `legs` (appendices
A to C), `core`, `loops`, `static_elimination` (pivots chosen once), `inverse` and `direct` (the models),
`module_graph` and `stages` (the graph and where it is cut). `guards` tells when a sample needs the general
path.

May import: `program`, and what `compiled` may.
"""
