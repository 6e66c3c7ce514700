"""The choice of the engine: the general path, or the robot's models compiled from C."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from ...errors import HybridynError, ModelError
from .text import counted

if TYPE_CHECKING:
    from ...compiled.model import CompiledRobot
    from ...effects import Effects
    from ...streams.postures import Assemble
    from ...structure.robot import HybridRobot
    from ...tables.columns import Layout

#: Samples times freedoms above which building a model pays: about seven seconds on the general path.
WORTH = 3_000_000
#: Rows from which it pays where postures are assembled: some 3 ms each on the general path for any robot.
WORTH_OF_POSTURES = 2_000
#: The same for `simulate`, where samples come one after the other: the general path is slow without batches.
WORTH_IN_TIME = 40_000
#: The same for `effects`, which builds a model for each set of effects: for the LX4 with friction this takes
#: half a minute on two cores, as long as the general path takes for this many samples.
WORTH_OF_EFFECTS = 2_000_000
ENGINES = ("general", "compiled")

HANDED_OVER = "near lost rank, loops open by more than rounding, or a force that no motor gives"


#: Adds `--engine` to a command, which receives `engine`: the engine that the user names, or None.
takes_engine = click.option(
    "--engine",
    type=click.Choice(ENGINES),
    help="Models in Python or in C.  [default: C where it pays]",
)


def worth_of(layout: Layout, robot: HybridRobot) -> int:
    """Return the samples times freedoms above which building a model pays for a table."""
    return WORTH if layout.full_state else min(WORTH, WORTH_OF_POSTURES * robot.nv)


class Engine:
    """The engine of a command, with counts for the summary.

    Attributes:
        model: The compiled models, or None for the general path.
        handed_over: Number of samples that they handed to the general path, added block by block, since
            blocks may be computed in other processes; None where the models count in this process.
    """

    def __init__(self, model: CompiledRobot | None, reason: str) -> None:
        self.model, self._reason = model, reason
        self.handed_over: int | None = None

    @property
    def assemble(self) -> Assemble | None:
        """The compiled models' function that assembles postures, or None for the general path."""
        return None if self.model is None else self.model.assemble

    def add(self, handed_over: int) -> None:
        """Add the number of samples that a block handed over."""
        self.handed_over = (self.handed_over or 0) + handed_over

    def __str__(self) -> str:
        """Return the line that names the engine and the reason."""
        if self.model is None:
            return f"engine: general ({self._reason})"
        again = self.model.recomputed if self.handed_over is None else self.handed_over
        more = f"; {counted(again, 'sample')} by the general path ({HANDED_OVER})" if again else ""
        return f"engine: compiled ({self._reason}){more}"


def choose_engine(
    asked: str | None,
    robot: HybridRobot,
    effects: Effects,
    samples: int | None,
    obstacles: dict[str, bool],
    worth: int | None = None,
) -> Engine:
    """Choose the engine: the one the user asks for, else by the robot and the number of samples.

    Args:
        asked: "general", "compiled" or None.
        effects: The effects that are computed.
        samples: Number of samples, or None if unknown.
        obstacles: By name, whether the user asks for something that compiled models do not support.
        worth: Samples times freedoms above which building a model pays; `WORTH` where left out.

    Raises:
        ModelError: "compiled" is asked for together with something that it does not support.
        CompileError: "compiled" is asked for and cannot be built.
    """
    if asked == "general":
        return Engine(None, "as asked")
    size, least = (samples or 0) * robot.nv, WORTH if worth is None else worth
    if asked is None and size < least:
        return Engine(None, f"{size:,} samples times freedoms; compiled from {least:,} on")
    wanted = [name for name, there in obstacles.items() if there]
    if wanted:
        reason = f"compiled models cannot do: {', '.join(wanted)}"
        if asked:
            raise ModelError(f"--engine compiled: {reason}; use --engine general")
        return Engine(None, reason)
    try:
        import hybridyn

        model = hybridyn.compile(robot, effects)
    except HybridynError as error:
        if asked:
            raise
        return Engine(None, f"not compiled: {error}")
    return Engine(model, "as asked" if asked else f"{size:,} samples times freedoms")
