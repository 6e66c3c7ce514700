"""The door of compiled models: all that other rooms use of them.

Rooms that run the equations in code of their own take `RobotPrograms` (the programs of a robot),
`sample_code` (C that runs them for one sample), `InertialColumns` (the columns of a regressor), and `verify`,
which compares new code with the general path.
"""

from .code.sample_code import sample_code
from .code.scalars import GUARD_LIMIT, c_text
from .compiling import compile, is_built, torque_models
from .derivatives import Derivatives, ddm_jacobian, idm_jacobian
from .equations.states import any_accelerations, moving_states
from .exporting import export
from .failures import as_compile_error, needs_casadi
from .inertial_columns import InertialColumns
from .library.laws import Law, Pieces
from .library.steps import Control, JointChart, Steps, Tableau, Taken
from .model import CompiledRobot
from .program import Program, stored
from .programs.closing.tables import TableAssembler
from .programs.designs import DesignsInSlots
from .programs.evaluating import DesignEvaluator, DesignTable
from .programs.robot_programs import RobotPrograms
from .programs.sources import asked_for
from .repeated import ddm, idm
from .second.derivatives import SecondDerivatives
from .studying import design_evaluator, exact_model, operations
from .verifying import verify

__all__ = [
    "GUARD_LIMIT",
    "CompiledRobot",
    "Control",
    "Derivatives",
    "DesignEvaluator",
    "DesignTable",
    "DesignsInSlots",
    "InertialColumns",
    "JointChart",
    "Law",
    "Pieces",
    "Program",
    "RobotPrograms",
    "SecondDerivatives",
    "Steps",
    "TableAssembler",
    "Tableau",
    "Taken",
    "any_accelerations",
    "as_compile_error",
    "asked_for",
    "c_text",
    "compile",
    "ddm",
    "ddm_jacobian",
    "design_evaluator",
    "exact_model",
    "export",
    "idm",
    "idm_jacobian",
    "is_built",
    "moving_states",
    "needs_casadi",
    "operations",
    "sample_code",
    "stored",
    "torque_models",
    "verify",
]
