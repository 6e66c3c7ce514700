"""Build the derivatives of the models as programs: those of each module, joined by the chain rule.

Read `nodes` (stages joined to functions), `local` (their derivatives), `adjoints` (the sweep back), `columns`
(derivatives over coordinates), then `inverse` and `direct`.

May import: what `programs` may.
"""
