"""Assembly: from given motor positions and platform poses to postures that close every loop.

Read `requests` (the caller's input, checked), `module_request` (the same for one module), `assemble`,
`task`, `follow` (continuation from sample to sample on one branch). `assemblies` searches for all postures;
`findings` and `free_motions` report what looks wrong in a robot; `residual` computes closure residuals.

May import: `structure` and below.
"""
