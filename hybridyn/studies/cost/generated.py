"""The reference: the inverse model as generated C in 113-bit arithmetic."""

from __future__ import annotations

import numpy as np

from ...effects.choice import Effects
from ...errors import HybridynError
from ...spatial import Array
from ...structure.robot import HybridRobot


def exact_efforts(robot: HybridRobot, effects: Effects, q: Array, v: Array, a: Array) -> Array | str:
    """Compute motor efforts in 113-bit arithmetic, rounded at the end.

    Returns:
        Efforts, shape (T, motors), [N or N m]; or the reason why they cannot be computed.
    """
    try:
        from ...compiled.library.calls import load
        from ...compiled.programs.whole_robot import programs

        library = load([programs(robot, effects, models=("idm",))["idm"]], dtype="float128")
        (tau,), guard = library.batch("idm", q, v, a)
    except HybridynError as error:
        return f"no C code: {error}"
    except ImportError as error:
        return f"no C code: {error.name or error} is not installed"
    if not np.all(guard <= 1.0):
        return "the compiled model is not certain of every sample"
    return np.asarray(tau, dtype=float)
