"""One robot compiled to straight-line C.

Read `program` (kernels and the order of their calls), `equations/` (one module in CasADi), `programs/` (a
whole robot as calls), `code/` (programs to C), `library/` (compiler, cache, calls), then `model`
(`CompiledRobot`), `compiling` (`hybridyn.compile`), `failures` and `verifying`. `export` writes C for a
controller, `derivatives` differentiates the models.

May import: `dynamics`, `assembly`, `manifold` and below.
"""
