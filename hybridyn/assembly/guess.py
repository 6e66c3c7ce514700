"""The initial posture of an assembly: the home posture, or one that the caller gives."""

from __future__ import annotations

import numpy as np

from ..errors import AssemblyError
from ..spatial import LARGEST, Array
from ..structure.robot import HybridRobot
from ..structure.samples import as_numbers


def first_guess(robot: HybridRobot, guess: Array | None) -> Array:
    """Return the initial posture, shape (nq,); the home posture by default.

    Raises:
        AssemblyError: It has a wrong size, a number that is not finite or too large, or a joint's cosine and
            sine, or quaternion, of length zero.
    """
    if guess is None:
        return robot.home
    guess = as_numbers(guess, "guess").reshape(-1)
    if guess.shape != (robot.nq,):
        raise AssemblyError(f"guess has {guess.size} entries, the robot's q has {robot.nq}")
    check_guess(robot, guess)
    return guess


def check_guess(robot: HybridRobot, guess: Array) -> None:
    """Raise if initial postures, shape (..., nq), are none; the errors are those of `first_guess`."""
    if not (np.abs(guess) <= LARGEST).all():
        raise AssemblyError(f"guess has a number that is not finite, or above {LARGEST:.0e}")
    for columns in robot.unit_coordinates:
        if not guess[..., columns].any(axis=-1).all():
            raise AssemblyError("guess has a joint whose cosine and sine, or quaternion, are all zero")
