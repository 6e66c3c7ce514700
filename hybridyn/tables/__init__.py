"""Tables of numbers with named columns, CSV or Parquet: reading trajectories, writing results.

Read `csv_rows`, `opening` (rows in blocks), `columns` (the meaning of a header), `trajectory` (from rows to
motions), `rates` (fitted rates), `results` (files that appear complete or not at all),
`over_time` (means and peaks).

May import: `description` and below.
"""
