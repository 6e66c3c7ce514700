"""Tables of numbers with named columns: trajectories in, results out, as CSV or Parquet.

Read `table` (rows in blocks), `opening`, `columns` (what a header says), `trajectory` (from rows to
motions), `rates` (rates that a table leaves out), `results` (files that are complete or not there).

May import: `description` and below.
"""
