"""Check that the rows and steps of a run fit in memory."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from ..errors import TrajectoryError
from ..structure.robot import HybridRobot

#: Memory of one number of a row, in samples, result, table and text together [bytes].
NUMBER_BYTES = 48
#: Memory of a row besides its numbers, and of a step: list entries and headers of small arrays [bytes].
ROW_BYTES, STEP_BYTES = 400, 40
#: File in which Linux states the memory limit of a container.
CONTAINER = Path("/sys/fs/cgroup/memory.max")


def check_run_size(robot: HybridRobot, rows: float, steps: float, mend: str) -> None:
    """Check, before a run starts, that its rows and steps fit in memory.

    Args:
        rows: Number of output samples; may be infinite.
        steps: Number of fixed steps, 0 for adaptive methods; may be infinite.
        mend: Advice that ends the message.

    Raises:
        TrajectoryError: The run needs more memory than is available.
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
    """Return the memory of this machine, or of its container where that is less [bytes]."""
    own = float(os.sysconf("SC_PAGE_SIZE")) * os.sysconf("SC_PHYS_PAGES")
    with contextlib.suppress(OSError, ValueError):  # no such file, or "max"
        own = min(own, float(CONTAINER.read_text()))
    return own
