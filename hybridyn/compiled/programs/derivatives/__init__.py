"""Build the derivatives of the models as programs: those of each module, joined by the chain rule.

Read `nodes` (stages joined to functions, and their derivatives), `sweeps` (over them, both ways), `columns`
(derivatives over coordinates), `relations` (of one group of modules), `results` (of all groups), then
`models`. Over motors also `motor_motion` (how joints follow motors). `evaluation` loads and calls them.

May import: what `programs` may.
"""
