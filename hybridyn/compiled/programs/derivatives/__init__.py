"""Build the derivatives of the models as programs: those of each module, joined by the chain rule.

Read `sweeps` (over stages joined to nodes, both ways), `columns` (derivatives over coordinates), `relations`
(of one group of modules), `results` (of all groups), then `models`. Over motors also `motor_motion` (how
joints follow motors). `evaluation` loads and calls them.

May import: what `programs` may.
"""
