"""Generate the programs of a robot's models and their C source."""

from __future__ import annotations

import hashlib
import pickle
from dataclasses import replace
from typing import TYPE_CHECKING

from ...effects.choice import Effects
from ...structure.robot import HybridRobot
from ..code.scalars import Scalar
from ..failures import as_compile_error

if TYPE_CHECKING:
    from ..code.library_source import Source
    from ..program import Program


def robot_key(robot: HybridRobot, effects: Effects | None) -> str:
    """Return a hash of everything that the models of a robot depend on; without effects, its kinematics."""
    facts = (
        robot.description, robot.base, robot.gravity, robot.motors, robot.home, robot.closure_tolerance,
        robot.rank_tolerance, sorted(robot.held), robot.payloads, effects,
    )  # fmt: skip
    return hashlib.sha256(pickle.dumps(facts)).hexdigest()


def source_of(robot: HybridRobot, effects: Effects, scalar: Scalar) -> Source:
    """Generate the C source of a robot's models.

    Raises:
        CompileError: casadi is not installed.
    """
    from ..needs import needs_casadi

    needs_casadi()
    from ..code.library_source import library_source

    return library_source(list(write_programs(robot, effects, scalar.name).values()), scalar)


def write_programs(robot: HybridRobot, effects: Effects, dtype: str = "float64") -> dict[str, Program]:
    """Generate the programs of a robot's models.

    Raises:
        CompileError: casadi is not installed, or the models cannot be generated.
    """
    from ..needs import needs_casadi

    needs_casadi()
    from .whole_robot import programs

    with as_compile_error(robot):
        written = programs(robot, effects, dtype=dtype)
    return {name: replace(program, name=name) for name, program in written.items()}
