"""Warn if a result has no correct digit because its terms cancel.

There is no warning if the rounding is below a millionth of the effect of the robot's weight, since such a
result counts as zero. Without gravity there is nothing to compare with, and there is no warning.
"""

from __future__ import annotations

import logging

import numpy as np

from ..spatial import Array, Index
from ..structure.module import Module
from ..structure.robot import HybridRobot

#: Rounding of a sum, relative to its largest term.
NOISE = 8 * float(np.finfo(float).eps)
#: Rounding below this part of the effect of the robot's weight is harmless.
HARMLESS = 1e-6

_log = logging.getLogger("hybridyn")


def robot_weight(robot: HybridRobot) -> float:
    """Return the weight of all bodies [N]."""
    mass = sum(body.mass for body in robot.bodies.bodies)
    return mass * float(np.linalg.norm(robot.gravity))


def warn_of_lost_efforts(module: Module, Q: Array, size: Array, weight: float) -> None:
    """Log a warning for samples at which the efforts of a module have no correct digit.

    Args:
        Q: Generalised force needed along each motion, shape (T, N), [N m].
        size: Largest term in the sum Q, shape (T,), [N m].
        weight: Largest generalised force that the robot's weight can cause [N m].
    """
    if not module.motors:
        return
    lost = _lost(np.abs(Q).max(axis=1, initial=0.0), size, weight)
    _warn(module, "efforts", lost, size, "N m")


def warn_of_lost_accelerations(module: Module, x_ddot: Array, terms: Array, gravity: float) -> None:
    """Log a warning for samples at which the accelerations of a module have no correct digit.

    Args:
        x_ddot: Accelerations of the module, shape (T, n).
        terms: Largest term in their sum, shape (T,), [rad/s^2].
        gravity: Norm of the acceleration of gravity [m/s^2].
    """
    m = module.mechanism
    left = np.abs(x_ddot / m.reduction.col_scale).max(axis=1, initial=0.0)
    _warn(module, "accelerations", _lost(left, terms, gravity / m.length), terms, "rad/s^2")


def _lost(left: Array, size: Array, natural: float) -> Index:
    """Return the samples at which a sum is rounding, and the rounding is not harmless.

    Args:
        left: Size of the sum, shape (T,).
        size: Largest term in the sum, shape (T,).
        natural: Effect of the robot's weight, in the unit of the sum; 0 without gravity.
    """
    if natural <= 0.0:
        return np.zeros(0, dtype=int)
    return np.flatnonzero((left <= NOISE * size) & (NOISE * size > HARMLESS * natural))


def _warn(module: Module, what: str, lost: Index, size: Array, unit: str) -> None:
    """Log the number of samples and the worst one, if there are any."""
    if len(lost):
        worst = int(lost[np.argmax(size[lost])])
        _log.warning(
            "module '%s': its %s have no correct digit at %d samples (worst: sample %d): terms of %.1e %s "
            "cancel, and only their rounding of %.1e %s remains. Slow the motion down, or reduce the loads",
            module.name, what, len(lost), worst, size[worst], unit, NOISE * size[worst], unit,
        )  # fmt: skip
