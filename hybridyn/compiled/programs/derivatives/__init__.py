"""Build the derivatives of the models as programs: those of each module, joined by the chain rule.

Read `nodes` (stages joined to functions), `local` (their derivatives), `adjoints` (the sweep back), `columns`
(derivatives over coordinates), then `inverse` and `direct`. Over motors: `tangents` (the sweep forward),
`linear` (its steps where a node has one copy), `motor_motion` (how joints follow motors), `motor_forces`,
then `motor_inverse` and `motor_direct`. `evaluation` loads and calls them.

May import: what `programs` may.
"""
