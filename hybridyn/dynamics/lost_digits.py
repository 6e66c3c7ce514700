"""Warn where a result has no correct digit, because its terms cancel.

A digit is missed only where the robot would notice: rounding below a millionth of what its weight does is the
zero that it should be. Without gravity there is nothing to compare with, and nothing is said.
"""

from __future__ import annotations

import logging

import numpy as np

from ..spatial import Array, Index
from ..structure.module import Module
from ..structure.robot import HybridRobot

#: Rounding of a sum, relative to its largest term.
NOISE = 8 * float(np.finfo(float).eps)
#: Part of what weight does below which rounding does no harm.
HARMLESS = 1e-6

_log = logging.getLogger("hybridyn")


def robot_weight(robot: HybridRobot) -> float:
    """Return the weight of all bodies [N]."""
    mass = sum(body.mass for body in robot.bodies.bodies)
    return mass * float(np.linalg.norm(robot.gravity))


def warn_of_lost_efforts(module: Module, Q: Array, size: Array, weight: float) -> None:
    """Log samples at which no digit of a module's efforts is left.

    Args:
        module: The module.
        Q: Generalised force needed along each motion, shape (T, N), [N m].
        size: Largest term that Q was summed from, shape (T,), [N m].
        weight: What the robot's weight does at most [N m].
    """
    if not module.motors:
        return
    lost = _lost(np.abs(Q).max(axis=1, initial=0.0), size, weight)
    _warn(module, "efforts", lost, size, "N m")


def warn_of_lost_accelerations(module: Module, x_ddot: Array, terms: Array, gravity: float) -> None:
    """Log samples at which no digit of a module's accelerations is left.

    Args:
        module: The module.
        x_ddot: Its accelerations, shape (T, n).
        terms: Largest term that they were summed from, shape (T,), [rad/s^2].
        gravity: Size of the acceleration of gravity [m/s^2].
    """
    m = module.mechanism
    left = np.abs(x_ddot / m.reduction.col_scale).max(axis=1, initial=0.0)
    _warn(module, "accelerations", _lost(left, terms, gravity / m.length), terms, "rad/s^2")


def _lost(left: Array, size: Array, natural: float) -> Index:
    """Return the samples at which a sum is rounding, and one that matters."""
    if natural <= 0.0:
        return np.zeros(0, dtype=int)
    return np.flatnonzero((left <= NOISE * size) & (NOISE * size > HARMLESS * natural))


def _warn(module: Module, what: str, lost: Index, size: Array, unit: str) -> None:
    """Log the worst of the samples, if there are any."""
    if len(lost):
        worst = int(lost[np.argmax(size[lost])])
        _log.warning(
            "module '%s': no digit of its %s is left at %d samples, the worst %d: terms of %.1e %s cancel, "
            "and their rounding of %.1e %s is all there is. Slow the motion down, or state smaller loads",
            module.name, what, len(lost), worst, size[worst], unit, NOISE * size[worst], unit,
        )  # fmt: skip
