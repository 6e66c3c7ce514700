"""Close loops in expressions: steps, rates and accelerations of any tree of modules of one shape.

`engine` takes the tree, its pivots and its idle motions; rows come from `equations.loops` or from what is
prescribed (`programs.closing.rows`).

May import: `equations`, and what `compiled` may.
"""
