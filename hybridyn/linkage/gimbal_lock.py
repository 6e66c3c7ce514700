"""Gimbal lock of wrists: the end follows its target with least-norm joint rates."""

from __future__ import annotations

import logging

import numpy as np

from ..spatial import Array, Mask

#: A wrist whose reciprocal condition falls below this is in gimbal lock.
GIMBAL_LOCK = 1e-9

_log = logging.getLogger("hybridyn")


def is_locked(S: Array) -> Mask:
    """Check at which samples a wrist is in gimbal lock.

    Args:
        S: Joint columns of the wrist, as `WristMotion.jacobian` computes them, shape (T, 6, joints).

    Returns:
        Mask, shape (T,).
    """
    s = np.linalg.svd(S, compute_uv=False)
    return s[:, -1] <= GIMBAL_LOCK * s[:, 0]


def warn_of_gimbal_lock(S: Array) -> None:
    """Log a warning if a wrist is in gimbal lock at some sample; its rates there are least-norm."""
    locked = np.flatnonzero(is_locked(S))
    if len(locked):
        _log.warning(
            "gimbal lock of a wrist at %d samples, the first %d: rates of its joints are the least-norm "
            "ones, nothing else is affected",
            len(locked),
            locked[0],
        )
