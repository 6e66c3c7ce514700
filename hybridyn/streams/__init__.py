"""Run the rows of a table through a model, block by block, in one process or several.

Read `one_pass` (a robot and a table, read once), `postures` (from motion to postures), `departures` (limits
that a motion exceeds), `workers` (other processes).

May import: `compiled`, `dynamics`, `assembly`, `tables` and below.
"""
