"""Arrays of a compiled model that only some versions of MuJoCo have."""

from __future__ import annotations

from typing import Any

import numpy as np


def nonzero(model: Any, field: str, row: int) -> bool:
    """Say whether a row of a model's array has a nonzero entry; False where MuJoCo has no such array."""
    values = getattr(model, field, None)
    return values is not None and bool(np.any(values[row]))


def number(model: Any, field: str, row: int) -> float:
    """Return an entry of a model's array; 0 where MuJoCo has no such array."""
    values = getattr(model, field, None)
    return 0.0 if values is None else float(np.ravel(values[row])[0])
