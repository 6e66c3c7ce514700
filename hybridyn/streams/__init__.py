"""Run the rows of a table through a model, block by block, in one process or several.

Read `blocks` (the loop over blocks), `postures` (from a table's motion to postures), `workers` (other
processes).

May import: `compiled`, `dynamics`, `assembly`, `tables` and below.
"""
