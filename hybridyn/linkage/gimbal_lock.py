"""Where a wrist's joints lose a direction: its end moves as it must, its rates are the least-norm ones."""

from __future__ import annotations

import logging

import numpy as np

from ..spatial import Array, Mask

#: A wrist whose reciprocal condition falls below this is in gimbal lock.
GIMBAL_LOCK = 1e-9

_log = logging.getLogger("hybridyn")


def is_locked(S: Array) -> Mask:
    """Say where a wrist's joints lose a direction, from `wrist_rates` (T, 6, joints), shape (T,)."""
    s = np.linalg.svd(S, compute_uv=False)
    out: Mask = s[:, -1] <= GIMBAL_LOCK * s[:, 0]
    return out


def flag_gimbal_lock(S: Array) -> None:
    """Log samples at which a wrist's joints lose a direction; their rates are the least-norm ones."""
    locked = np.flatnonzero(is_locked(S))
    if len(locked):
        _log.warning(
            "gimbal lock of a wrist at %d samples, the first %d: rates of its joints are the least-norm "
            "ones, nothing else is affected",
            len(locked),
            locked[0],
        )
