"""Charts of results.

Read `panels` first: the contents of a figure as plain data. `motion`, `reports`, `identification`, `sweep`
and `cost` build panels from results. `as_matplotlib` and `as_page` draw panels. `module_tree` is what `info`
tells and `structure` draws; `workspace` draws its own figure.

May import: `studies` and below.
"""
