"""Everything that draws a chart.

Read `panels` (what a figure shows, as plain data), `motion`, `table` and `effects` (from results to
panels), then `as_matplotlib` and `as_page` (from panels to a file). `plot` is for programs. `structure`,
`workspace`, `sizing` and `cost` draw their own figures.

May import: `studies` and below.
"""
