"""Build the derivatives of the models as programs: those of each module, joined by the chain rule.

Read `nodes` (stages joined to functions), `local` (their derivatives), `sweeps` (over them, both ways),
`columns` (derivatives over coordinates), `relations` (of one group of modules), `responses` and `results`
(of all groups), then `direct` and `inverse`. Over motors also `motion` and `motor_motion` (how joints follow
motors). `evaluation` loads and calls them.

May import: what `programs` may.
"""
