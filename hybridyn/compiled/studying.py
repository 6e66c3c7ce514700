"""What studies ask of compiled models: results in 113-bit arithmetic, operations, and designs of a sweep."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np

from ..effects.choice import Effects
from ..errors import HybridynError
from ..spatial import Array
from ..structure.parameters.slots import Slot
from ..structure.robot import HybridRobot
from .compiling import inverse_model
from .library.calls import Library, load
from .program import Call
from .programs.designs import DesignsInSlots
from .programs.evaluating import DesignEvaluator


def exact_model(model: str, robot: HybridRobot, effects: Effects, state: Sequence[Array]) -> list[Array]:
    """Compute a model in 113-bit arithmetic, rounded at the end, as blocks of shape (T, n).

    Args:
        state: Its arguments, shapes (T, n); a moving base does not accelerate.

    Raises:
        HybridynError: The C code cannot be built, or it is not certain of every sample.
        ImportError: CasADi is not installed.
    """
    from .programs.whole_robot import programs

    program = programs(robot, effects, models=(model,))[model]
    base = [np.zeros((len(state[0]), size)) for _, size in program.inputs[3:]]  # that of a moving base
    found, guard = load([program], dtype="float128").batch(program.name, *state, *base)
    if not np.all(guard <= 1.0):
        raise HybridynError("the compiled model is not certain of every sample")
    return [np.asarray(x, dtype=float) for x in found]


def operations(robot: HybridRobot, effects: Effects, model: str) -> int:
    """Count the operations of a model without building code; effects of time and of contact count nothing."""
    from .programs.whole_robot import programs

    base = [effects.base.name] if effects.base else []
    on = effects.without(*(law.name for law in effects.links), *base)
    program = programs(robot, on, models=(model,))[model]
    calls = (step for step in program.steps if isinstance(step, Call))
    return sum(program.kernels[c.kernel].function.n_instructions() * c.copies for c in calls)


def design_evaluator(robot: HybridRobot, effects: Effects, slots: Sequence[Slot]) -> DesignEvaluator:
    """Return what evaluates designs of one structure; its libraries are built or loaded at the first use.

    Args:
        slots: Numbers of the robot's description that differ between the designs.

    Raises:
        HybridynError: There are no compiled models with these effects.
    """
    artifact, parameters = inverse_model(robot, effects, slots)
    inverse = cache(lambda: artifact.loaded(Library).programs["idm"])
    return DesignEvaluator(DesignsInSlots(robot, effects, parameters), inverse, artifact)
