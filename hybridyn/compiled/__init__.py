"""One robot compiled to straight-line C.

Read `program` (kernels and the order of their calls), `equations/` (one module in CasADi), `loops/` (how its
loops close), `programs/` (a whole robot as calls), `code/` (programs to C), `library/` (compiler, cache,
calls), then `model` (`CompiledRobot`), `compiling` (`hybridyn.compile`), `failures` and `verifying`.
`exporting` writes C for a controller, `derivatives` differentiates the models.

`inertial_columns` are those of a regressor. `__init__.pyi` is the door: the names that other rooms use.

May import: `dynamics`, `assembly`, `manifold` and below.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
