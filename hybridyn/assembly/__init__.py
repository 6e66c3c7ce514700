"""From what is given (motors, platform poses) to postures that close every loop.

Read `requests` (what the caller wants), `module_request` (the same for one module), `assemble`, `follow`
(from row to row on one branch). `assemblies` searches all postures; `findings` and `free_motions` say what
a careful colleague would; `residual` measures how far loops are open.

May import: `structure` and below.
"""
