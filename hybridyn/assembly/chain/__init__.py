"""Poses of links through several modules: the loops stay per module, the targets couple the modules.

Read `coupling` (which modules a pose couples), `bodies` (motions of several modules' trees), `places` (where
frames are on these), `problem` (rows, and Newton's step by one small system over the modules' motions),
`task` (the problem at every sample), `rates` (rates and accelerations of the least motion), `solve`, `left`
(to a rule), `shortfall` (what no posture reaches), `between` and `coordinates` (what moves a link in
another). Postures that make a value least are in `second` (the values), `chart` (derivatives along open
motions), `lowest` (Newton's descent) and `ahead` (rates).
"""
