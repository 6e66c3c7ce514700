"""Close loops in expressions: steps, rates and accelerations of any tree of modules of one shape.

Read `spanning_rows` (one closure), `loop_rows` (all closures and couplings of a tree, and the pivots of the
spanning tree), `engine` (what follows from rows with pivots) and `bounds` (of how far rows turn).

May import: `equations`, and what `compiled` may.
"""
