"""The choice of the engine: the general path, or the robot's models compiled from C."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import hybridyn

from ...effects import Effects
from ...errors import HybridynError, ModelError
from ...streams.one_pass import Pass
from ...structure.robot import HybridRobot
from ...tables.layout import Layout
from .text import counted

if TYPE_CHECKING:  # the general path does without the models
    from ...compiled import CompiledRobot

#: Samples times freedoms above which building a model pays: about seven seconds on the general path.
WORTH = 3_000_000
#: Rows from which it pays where postures are assembled: some 3 ms each on the general path for any robot.
WORTH_OF_POSTURES = 2_000
#: For `simulate`, where samples come one after the other, measured in processor time on robots of 4 to 84
#: freedoms: what a sample costs on the general path, and a build, each with its part per freedom [s].
SAMPLE_IN_TIME, BUILD = (2e-3, 2.6e-4), (1.8, 0.05)
#: A model in the cache pays from this part of them on: it takes some tenths of a second to load.
LOADED = 1 / 20
#: The same for `effects`, which builds a model for each set of effects: for the LX4 with friction this takes
#: half a minute on two cores, as long as the general path takes for this many samples.
WORTH_OF_EFFECTS = 2_000_000


def worth_of(layout: Layout, robot: HybridRobot) -> int:
    """Return the samples times freedoms above which building a model pays for a table."""
    return WORTH if layout.full_state else min(WORTH, WORTH_OF_POSTURES * robot.nv)


def worth_in_time(freedoms: int) -> int:
    """Return the samples times freedoms above which a build takes less time than `simulate` saves by it."""
    build, sample = (fixed + each * freedoms for fixed, each in (BUILD, SAMPLE_IN_TIME))
    return round(freedoms * build / sample)


@dataclass(eq=False)
class EngineChoice:
    """The engine of a command.

    Attributes:
        model: The compiled models, or None for the general path.
        reason: Why it was chosen.
        handed_over: Number of samples that the models handed to the general path, in all processes.
    """

    model: CompiledRobot | None
    reason: str
    handed_over: int = 0

    def __str__(self) -> str:
        """Return the line that names the engine and the reason."""
        more = (
            f"; {counted(self.handed_over, 'sample')} by the general path (near lost rank, loops open by "
            "more than rounding, or a force that no motor gives)"
            if self.handed_over
            else ""
        )
        return f"engine: {'general' if self.model is None else 'compiled'} ({self.reason}){more}"


def engine_for_table(
    asked: str | None, given: Pass, effects: Effects, obstacles: Mapping[str, bool]
) -> EngineChoice:
    """Choose the engine for a robot and a table; wrenches in it are an obstacle, too.

    Arguments and errors are those of `choose_engine`.
    """
    robot, layout = given.robot, given.layout
    obstacles = {**obstacles, "wrenches in the table": bool(layout.wrenches)}
    rows, worth = given.table.rows, worth_of(layout, robot)
    return choose_engine(asked, robot, effects, rows, worth, obstacles, alone=layout.full_state)


def choose_engine(
    asked: str | None, robot: HybridRobot, effects: Effects, samples: int | None, worth: int,
    obstacles: Mapping[str, bool], *, alone: bool = False,
) -> EngineChoice:  # fmt: skip
    """Choose the engine: the one the user asks for, else by the robot and the number of samples.

    Args:
        asked: "general", "compiled" or None.
        effects: The effects that are computed.
        samples: Number of samples, or None if unknown.
        worth: Samples times freedoms above which building a model pays.
        obstacles: By name, whether the user asks for something that compiled models do not support.
        alone: Whether the models of `compile` suffice, so that none is built where they lie in the cache.

    Raises:
        ModelError: "compiled" is asked for together with something that it does not support.
        CompileError: "compiled" is asked for and cannot be built.
    """
    if asked == "general":
        return EngineChoice(None, "as asked")
    size = (samples or 0) * robot.nv
    wanted = ", ".join([*(name for name, there in obstacles.items() if there), *effects.uncompiled])
    cached = (
        alone
        and not wanted
        and asked is None
        and LOADED * worth <= size < worth
        and _is_built(robot, effects)
    )
    if asked is None and size < worth and not cached:
        return EngineChoice(None, f"{size:,} samples times freedoms; compiled from {worth:,} on")
    if wanted and asked:
        raise ModelError(f"--engine compiled: compiled models cannot do: {wanted}; use --engine general")
    if wanted:
        return EngineChoice(None, f"compiled models cannot do: {wanted}")
    try:
        model = hybridyn.compile(robot, effects, wait=True)  # results are the same, bit for bit
    except HybridynError as error:
        if asked:
            raise
        return EngineChoice(None, f"not compiled: {error}")
    known = "; the model is in the cache" * cached
    return EngineChoice(model, "as asked" if asked else f"{size:,} samples times freedoms{known}")


def _is_built(robot: HybridRobot, effects: Effects) -> bool:
    """Return whether the models lie in the cache; they need no CasADi then."""
    try:
        from ...compiled import is_built
    except (ImportError, HybridynError):
        return False
    return is_built(robot, effects)
