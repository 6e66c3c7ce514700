"""hybridyn: dynamics of hybrid robots, exact and linear in the number of modules.

The public names, imported when first used so that the command line starts quickly.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .assembly import assemble
    from .ddm import ddm
    from .errors import (
        ActuationError,
        AssemblyError,
        HybridynError,
        ModelError,
        SingularityError,
        TrajectoryError,
    )
    from .forward import closure_residual
    from .idm import idm
    from .loading import load
    from .reactions import Reactions
    from .robot import HybridRobot

__version__ = "0.1.0"

_HOME = {
    "ActuationError": "errors",
    "AssemblyError": "errors",
    "HybridynError": "errors",
    "ModelError": "errors",
    "SingularityError": "errors",
    "TrajectoryError": "errors",
    "assemble": "assembly",
    "closure_residual": "forward",
    "ddm": "ddm",
    "idm": "idm",
    "load": "loading",
    "Reactions": "reactions",
    "HybridRobot": "robot",
}

__all__ = [
    "ActuationError",
    "AssemblyError",
    "HybridRobot",
    "HybridynError",
    "ModelError",
    "Reactions",
    "SingularityError",
    "TrajectoryError",
    "__version__",
    "assemble",
    "closure_residual",
    "ddm",
    "idm",
    "load",
]


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module 'hybridyn' has no attribute {name!r}")
    from importlib import import_module

    value = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    globals()[name] = value
    return value
