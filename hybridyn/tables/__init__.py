"""Tables of numbers with named columns, CSV, Parquet or bags of ROS 2: reading trajectories, writing results.

Read `csv_rows`, `bags`, `opening` (rows in blocks), `layout`, `columns` and `header_faults` (the meaning of a
header), `trajectory` (from rows to motions), `rates` (fitted rates), `tree_coordinates` (states of the
spanning tree), `results` (files that appear complete or not at all), `over_time` (means and peaks).

May import: `description` and below.
"""
