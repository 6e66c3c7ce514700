"""Charts of results.

Read `panels` first: the contents of a figure as plain data. `motion`, `table`, `sizing` and `reports`
build panels from results. `as_matplotlib` and `as_page` draw panels. `plot` has the functions for
programs. `structure`, `workspace`, `sweep` and `cost` draw their own figures.

May import: `studies` and below.
"""
