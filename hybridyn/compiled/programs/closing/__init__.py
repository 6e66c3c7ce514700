"""Write the programs that compute all joints from given motors and platform poses (`assembly.assemble`).

Read `extended` (the tree after the cuts, with its wrists), `given` (what is prescribed), `module_parts`,
`own_requests`, `coupled` and `members` (which modules are closed, alone or together), `rows` (closures and
targets as expressions), `unknowns`, `kernels`, `closing_source` (programs and their C), `closing_library`,
`checked_rows` and `libraries` (found, or built and checked), `assembling` (rows in C, `library.closed_rows`,
and the general path behind them), `apart` (samples that do not follow each other) and `tables` (which rows of
a table are closed in C).

May import: `writer`, `equations`, `loops`, `code`, `library`, and what `programs` may.
"""
