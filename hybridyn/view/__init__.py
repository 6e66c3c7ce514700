"""Seeing a robot: on a page in the browser, or in a picture or film without a screen.

Read `picture` (what is drawn), `drawing` (from a robot to its picture), `placing` (where bodies are), then
`page` (the browser) or `render` and `film` (files).

May import: `simulation`, `assembly` and below.
"""
