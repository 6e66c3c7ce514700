"""How large a run may be: rows and steps that this machine's memory can hold."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from ..errors import TrajectoryError
from ..structure.robot import HybridRobot

#: Memory of one number of a row: in the samples, the result, the table of them and its text [bytes].
NUMBER_BYTES = 48
#: Memory of a row beside its numbers, and of a step: entries of lists, and small arrays' heads [bytes].
ROW_BYTES, STEP_BYTES = 400, 40
#: Where Linux says how much memory a container may use.
CONTAINER = Path("/sys/fs/cgroup/memory.max")


def refuse_excess(robot: HybridRobot, rows: float, steps: float, mend: str) -> None:
    """Refuse a run whose rows and steps memory cannot hold, before it starts.

    Args:
        robot: The robot.
        rows: Output samples; need not be finite.
        steps: Fixed steps, 0 where errors choose them; need not be finite.
        mend: What to change.

    Raises:
        TrajectoryError: The run needs more memory than there is.
    """
    numbers = 1 + robot.nq + 2 * robot.nv + len(robot.motors) + 4
    needed = rows * (ROW_BYTES + numbers * NUMBER_BYTES) + steps * STEP_BYTES
    if not needed <= (there := memory()):
        counts = [f"{rows:.3g} rows"] * bool(rows) + [f"{steps:.3g} steps"] * bool(steps)
        raise TrajectoryError(
            f"{' and '.join(counts)} need {needed / 1e9:.2g} GB of memory, and there are {there / 1e9:.2g} "
            f"GB: {mend}"
        )


def memory() -> float:
    """Return the memory of this machine, or of its container where that has less [bytes]."""
    own = float(os.sysconf("SC_PAGE_SIZE")) * os.sysconf("SC_PHYS_PAGES")
    with contextlib.suppress(OSError, ValueError):  # no such file, or "max"
        own = min(own, float(CONTAINER.read_text()))
    return own
