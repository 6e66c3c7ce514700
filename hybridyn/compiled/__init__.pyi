"""The door of compiled models: all that rooms use that write no programs of their own."""

from .compiling import compile, is_built, torque_models
from .derivatives import Derivatives, ddm_jacobian, idm_jacobian
from .exporting import export
from .failures import needs_casadi
from .library.laws import Law, Pieces
from .library.steps import Control, JointChart, Steps, Tableau, Taken
from .model import CompiledRobot
from .programs.closing.tables import TableAssembler
from .programs.evaluating import DesignTable
from .repeated import ddm, idm
from .studying import DesignModels, exact_model, operations

__all__ = [
    "CompiledRobot",
    "Control",
    "Derivatives",
    "DesignModels",
    "DesignTable",
    "JointChart",
    "Law",
    "Pieces",
    "Steps",
    "TableAssembler",
    "Tableau",
    "Taken",
    "compile",
    "ddm",
    "ddm_jacobian",
    "exact_model",
    "export",
    "idm",
    "idm_jacobian",
    "is_built",
    "needs_casadi",
    "operations",
    "torque_models",
]
