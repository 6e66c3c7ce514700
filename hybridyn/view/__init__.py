"""Display of a robot: on a page in the browser, or as an image or video rendered without a screen.

Read `picture` (shapes as plain data), `drawing` (build the shapes of a robot) and `placing` (poses of the
bodies) first, then `page` (the browser; `sliders`, `grip` and
`panel` are parts of it) or `render` and `film` (files).

May import: `simulation`, `assembly` and below.
"""
