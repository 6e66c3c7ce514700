"""The inverse model as generated C code for any number type, without fallback to the general path."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ...effects.choice import Effects
from ...errors import HybridynError
from ...spatial import Array
from ...structure.robot import HybridRobot

#: Computes motor efforts, shape (T, motors), and the largest guard from q, v, a. Efforts are valid if the
#: guard is at most 1.
GeneratedModel = Callable[[Array, Array, Array], tuple[np.ndarray[Any, Any], float]]


def generated_idm(robot: HybridRobot, effects: Effects, dtype: str = "float64") -> GeneratedModel | str:
    """Build the inverse model as C code.

    Args:
        dtype: "float32", "float64", "longdouble" or "float128".

    Returns:
        The model, or the reason why it cannot be built.
    """
    try:
        from ...compiled.library.calls import load
        from ...compiled.programs.whole_robot import programs

        guards = "float32" if dtype == "float32" else "float64"
        library = load([programs(robot, effects, models=("idm",), dtype=guards)["idm"]], dtype=dtype)
    except HybridynError as error:
        return f"no C code: {error}"
    except ImportError as error:
        return f"no C code: {error.name or error} is not installed"

    def run(q: Array, v: Array, a: Array) -> tuple[np.ndarray[Any, Any], float]:
        """Compute efforts and the largest guard."""
        (tau,), guard = library.batch("idm", q, v, a)
        return tau, float(np.nan_to_num(np.max(guard, initial=0.0), nan=np.inf))

    return run
