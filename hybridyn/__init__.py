"""hybridyn: dynamics of hybrid robots, exact and linear in the number of modules.

The public names, imported when first used so that the command line starts quickly.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .assemblies import Assemblies, assemblies
    from .assembly import assemble
    from .check import check
    from .compiled.derivatives import ddm_jacobian, idm_jacobian
    from .compiled.model import CompiledRobot, compile
    from .ddm import ddm
    from .effects import with_effects
    from .energy import Energy, Power, centre_of_mass, energy, momentum, power
    from .errors import (
        ActuationError,
        AssemblyError,
        CompileError,
        HybridynError,
        ModelError,
        SingularityError,
        TrajectoryError,
    )
    from .events import Event, near_singularity
    from .forward import closure_residual
    from .idm import idm
    from .link_motion import LinkMotion, kinematics
    from .loading import load
    from .reactions import Reactions
    from .robot import HybridRobot
    from .simulate import simulate

__version__ = "0.1.0"

_HOME = {
    "ActuationError": "errors",
    "AssemblyError": "errors",
    "CompileError": "errors",
    "HybridynError": "errors",
    "ModelError": "errors",
    "SingularityError": "errors",
    "TrajectoryError": "errors",
    "Assemblies": "assemblies",
    "assemble": "assembly",
    "assemblies": "assemblies",
    "check": "check",
    "closure_residual": "forward",
    "centre_of_mass": "energy",
    "compile": "compiled.model",
    "CompiledRobot": "compiled.model",
    "ddm": "ddm",
    "ddm_jacobian": "compiled.derivatives",
    "energy": "energy",
    "momentum": "energy",
    "power": "energy",
    "with_effects": "effects",
    "Energy": "energy",
    "Power": "energy",
    "kinematics": "link_motion",
    "LinkMotion": "link_motion",
    "idm": "idm",
    "idm_jacobian": "compiled.derivatives",
    "load": "loading",
    "Reactions": "reactions",
    "near_singularity": "events",
    "simulate": "simulate",
    "Event": "events",
    "HybridRobot": "robot",
}

__all__ = [
    "ActuationError",
    "Assemblies",
    "AssemblyError",
    "CompileError",
    "CompiledRobot",
    "Energy",
    "Event",
    "HybridRobot",
    "HybridynError",
    "LinkMotion",
    "ModelError",
    "Power",
    "Reactions",
    "SingularityError",
    "TrajectoryError",
    "__version__",
    "assemble",
    "assemblies",
    "centre_of_mass",
    "check",
    "closure_residual",
    "compile",
    "ddm",
    "ddm_jacobian",
    "energy",
    "idm",
    "idm_jacobian",
    "kinematics",
    "load",
    "momentum",
    "near_singularity",
    "power",
    "simulate",
    "with_effects",
]


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module 'hybridyn' has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    globals()[name] = value
    return value


class _Package(ModuleType):
    """A package whose public names win over the files they live in: `hybridyn.idm` is the function."""

    def __setattr__(self, name: str, value: object) -> None:
        if not (name in _HOME and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
