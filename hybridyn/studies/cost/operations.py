"""Operations of a model with some effects, from the program that C is written from: no code is built."""

from __future__ import annotations

from ...effects.choice import Effects
from ...errors import HybridynError
from ...structure.robot import HybridRobot


def operations(robot: HybridRobot, effects: Effects, model: str) -> float:
    """Count the operations of a model, "idm" or "ddm"; nan where no program can be written."""
    try:
        from ...compiled.program import Call
        from ...compiled.programs.whole_robot import programs

        program = programs(robot, effects, models=(model,))[model]
    except (HybridynError, ImportError):
        return float("nan")
    calls = (step for step in program.steps if isinstance(step, Call))
    return float(sum(program.kernels[c.kernel].function.n_instructions() * c.copies for c in calls))
