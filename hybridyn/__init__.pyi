"""The public names and the files they live in: one table for imports, `__all__` and type checkers."""

from . import effects as effects
from .assembly.assemble import assemble
from .assembly.task import closure_residual
from .compiled import CompiledRobot, SecondDerivatives, compile, ddm, ddm_jacobian, idm, idm_jacobian
from .conversion.convert import convert
from .conversion.target_files import Conversion
from .dynamics.energy import Energy, Power, centre_of_mass, energy, momentum, power
from .dynamics.link_motion import LinkMotion, kinematics
from .dynamics.motor_currents import MotorCurrents, motor_currents
from .dynamics.quantities.joint_map import JointMap, joint_map
from .dynamics.quantities.links import delassus, link_jacobian, operational_inertia
from .dynamics.quantities.model import bias, coriolis, coriolis_matrix, gravity, mass_matrix, motion_map
from .dynamics.reactions import Reactions
from .effects import with_effects
from .errors import (
    ActuationError,
    AssemblyError,
    CompileError,
    HybridynError,
    ModelError,
    PerformanceWarning,
    SingularityError,
    TrajectoryError,
)
from .gradients.design_gradients import DesignGradients
from .identification.base_parameters import BaseParameters, base_parameters
from .identification.excitation import Excitation, excitation
from .identification.identify import identify
from .identification.regressor import Regressor, regressor
from .identification.result import Identification
from .learning.creating import jax, torch
from .loading import from_pinocchio, load
from .optimal_control.casadi_model import casadi_model
from .simulation.events import Event, near_singularity
from .simulation.simulate import simulate
from .structure.robot import HybridRobot
from .studies.assemblies import Assemblies, assemblies
from .studies.check.check import check
from .studies.sweep.sweep import sweep
from .view.geometry_model import geometry_model
from .warp_batch.creating import warp

__version__: str

__all__ = [
    "ActuationError",
    "Assemblies",
    "AssemblyError",
    "BaseParameters",
    "CompileError",
    "CompiledRobot",
    "Conversion",
    "DesignGradients",
    "Energy",
    "Event",
    "Excitation",
    "HybridRobot",
    "HybridynError",
    "Identification",
    "JointMap",
    "LinkMotion",
    "ModelError",
    "MotorCurrents",
    "PerformanceWarning",
    "Power",
    "Reactions",
    "Regressor",
    "SecondDerivatives",
    "SingularityError",
    "TrajectoryError",
    "__version__",
    "assemble",
    "assemblies",
    "base_parameters",
    "bias",
    "casadi_model",
    "centre_of_mass",
    "check",
    "closure_residual",
    "compile",
    "convert",
    "coriolis",
    "coriolis_matrix",
    "ddm",
    "ddm_jacobian",
    "delassus",
    "energy",
    "excitation",
    "from_pinocchio",
    "geometry_model",
    "gravity",
    "identify",
    "idm",
    "idm_jacobian",
    "jax",
    "joint_map",
    "kinematics",
    "link_jacobian",
    "load",
    "mass_matrix",
    "momentum",
    "motion_map",
    "motor_currents",
    "near_singularity",
    "operational_inertia",
    "power",
    "regressor",
    "simulate",
    "sweep",
    "torch",
    "warp",
    "with_effects",
]
