"""The words of all commands: arguments, options and help. What a command does is in its module.

`shared` has what several commands have; `motions`, `robots`, `studies` and `middleware` have the commands.
"""

from .middleware import ros
from .motions import ddm, idm, simulate
from .robots import convert, home, info, plot, view
from .studies import compare, cost, identify, sweep, workspace

__all__ = [
    "compare", "convert", "cost", "ddm", "home", "identify", "idm", "info", "plot", "ros", "simulate",
    "sweep", "view", "workspace",
]  # fmt: skip
