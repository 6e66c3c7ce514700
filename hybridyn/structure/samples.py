"""Samples as arrays: one or a batch, checked before anything is computed."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..errors import TrajectoryError
from ..spatial import Array


def as_batch(array: ArrayLike, width: int, name: str) -> tuple[Array, bool]:
    """Return samples as (T, width) and say whether one single sample came in.

    Raises:
        TrajectoryError: Wrong shape, a table with named columns, or a number that is not finite.
    """
    if hasattr(array, "columns"):
        raise TrajectoryError(
            f"{name} is a table with named columns (a DataFrame), which has an order of its own: give an "
            "array in the robot's, table[names].to_numpy()"
        )
    try:
        out = np.asarray(array, dtype=float)
    except (TypeError, ValueError) as error:
        raise TrajectoryError(f"{name} is no array of numbers: {error}") from None
    single = out.ndim == 1
    if single:
        out = out[None]
    if out.ndim != 2 or out.shape[1] != width:
        raise TrajectoryError(f"{name} has shape {np.shape(array)}; wanted ({width},) or (T, {width})")
    bad = np.flatnonzero(~np.isfinite(out).all(axis=1))
    if len(bad):
        raise TrajectoryError(f"{name} is not finite at sample {bad[0]}", row=int(bad[0]) + 1)
    return out, single


def same_samples(**arrays: Array) -> None:
    """Refuse batches of different sizes.

    Raises:
        TrajectoryError: With the sizes.
    """
    sizes = [len(x) for x in arrays.values()]
    if len(set(sizes)) > 1:
        raise TrajectoryError(f"{', '.join(arrays)} have {', '.join(map(str, sizes))} samples")
