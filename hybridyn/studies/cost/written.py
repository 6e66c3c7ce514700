"""The inverse model written out as C, of any width of numbers, without the general path behind it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ...effects.choice import Effects
from ...errors import HybridynError
from ...spatial import Array
from ...structure.robot import HybridRobot

#: From q, v, a to motor efforts, shape (T, motors), and the largest guard, at most 1 where they hold.
Written = Callable[[Array, Array, Array], tuple[np.ndarray[Any, Any], float]]


def written_out(robot: HybridRobot, effects: Effects, dtype: str = "float64") -> Written | str:
    """Return the written-out inverse model, or why there is none.

    Args:
        robot: The robot.
        effects: What is computed.
        dtype: "float32", "float64", "longdouble" or "float128".
    """
    try:
        from ...compiled.library.calls import load
        from ...compiled.programs.whole_robot import programs

        guards = "float32" if dtype == "float32" else "float64"
        library = load([programs(robot, effects, models=("idm",), dtype=guards)["idm"]], dtype=dtype)
    except HybridynError as error:
        return f"not written out: {error}"
    except ImportError as error:
        return f"not written out: {error.name or error} is not installed"

    def run(q: Array, v: Array, a: Array) -> tuple[np.ndarray[Any, Any], float]:
        (tau,), guard = library.batch("idm", q, v, a)
        return tau, float(np.nan_to_num(np.max(guard, initial=0.0), nan=np.inf))

    return run
