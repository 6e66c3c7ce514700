from .middleware import ros
from .motions import ddm, idm, simulate
from .robots import convert, home, info, plot, view
from .studies import compare, cost, identify, sweep, workspace

__all__ = [
    "compare", "convert", "cost", "ddm", "home", "identify", "idm", "info", "plot", "ros", "simulate",
    "sweep", "view", "workspace",
]  # fmt: skip
