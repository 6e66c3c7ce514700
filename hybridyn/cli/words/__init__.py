"""The words of all commands: arguments, options and help. What a command does is in its module.

`shared` has what several commands have; `motions`, `robots`, `studies` and `middleware` have the commands.
`__init__.pyi` says which: the file of a command is imported when that command is used.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
