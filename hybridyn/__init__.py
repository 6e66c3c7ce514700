"""hybridyn: dynamics of hybrid robots, exact and linear in the number of modules.

`__init__.pyi` lists the public names and the files they live in. A name is imported when it is first used, so
that the command line starts quickly.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__version__ = "0.1.0"
__all__ = [*__all__, "__version__"]
