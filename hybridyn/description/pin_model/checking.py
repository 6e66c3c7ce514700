"""Refuse Pinocchio models and constraints whose numbers or joints cannot be those of a robot.

The fields of a `pinocchio.Model` can be set to anything; Pinocchio itself may then crash.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from ...errors import ModelError
from ..urdf.xml_node import LARGEST_NUMBER
from .numbers import joint_error

#: Fields with one number for each freedom, and whether they may be infinite.
PER_FREEDOM = {
    "armature": False, "damping": False, "friction": False, "rotorInertia": False, "rotorGearRatio": False,
    "effortLimit": True, "velocityLimit": True,
}  # fmt: skip
PER_COORDINATE = ("lowerPositionLimit", "upperPositionLimit")
#: Largest difference of R^T R from the identity for a rotation that was rounded in single precision.
ROTATION = 1e-5


def check_model(model: pin.Model) -> None:
    """Check the tree, placements, inertias and numbers of a model.

    Raises:
        ModelError: A joint hangs on one that follows it, or a number is not finite, or out of its range.
    """
    name = f"Pinocchio model '{model.name}'"
    for joint in range(1, model.njoints):
        if not 0 <= int(model.parents[joint]) < joint:
            raise joint_error(
                model, joint, f"hangs on joint {model.parents[joint]}, which does not come before it"
            )
        if not is_placement(model.jointPlacements[joint]):
            raise joint_error(model, joint, "its placement is not a finite rigid motion")
        inertia = model.inertias[joint]
        numbers = np.array([inertia.mass, *inertia.lever, *np.ravel(inertia.inertia)])
        if not is_finite(numbers) or inertia.mass < 0:
            raise joint_error(
                model, joint, "mass, lever and inertia must be finite, and the mass not negative"
            )
    for frame in model.frames:
        if not is_placement(frame.placement) or not 0 <= int(frame.parentJoint) < model.njoints:
            raise ModelError(
                f"{name}: frame '{frame.name}': its placement is not a finite rigid motion on a joint"
            )
    for word, endless in PER_FREEDOM.items():
        _check_numbers(name, word, getattr(model, word), model.nv, endless)
    for word in PER_COORDINATE:
        _check_numbers(name, word, getattr(model, word), model.nq, True)
    if not is_finite(model.gravity.linear):
        raise ModelError(f"{name}: its gravity is not finite")


def check_constraint(constraint: Any, name: str, joints: int) -> None:
    """Check the joints and placements of a constraint.

    Raises:
        ModelError: A joint does not exist, or a placement is not a finite rigid motion.
    """
    for side in (1, 2):
        joint = getattr(constraint, f"joint{side}_id")
        if not 0 <= joint < joints:
            raise ModelError(
                f"constraint '{name}': joint {joint} does not exist; the model has {joints}", element=name
            )
        if not is_placement(getattr(constraint, f"joint{side}_placement")):
            raise ModelError(
                f"constraint '{name}': joint{side}_placement is not a finite rigid motion", element=name
            )


def is_placement(placement: pin.SE3) -> bool:
    """Say whether a placement is finite and its rotation is one, up to single precision."""
    R = np.array(placement.rotation)
    if not is_finite(placement.homogeneous) or np.abs(R).max() > 2:
        return False
    return bool(np.abs(R.T @ R - np.eye(3)).max() < ROTATION and np.linalg.det(R) > 0)


def is_finite(values: Any) -> bool:
    """Say whether all numbers are as small as those of a file have to be."""
    return bool((np.abs(np.asarray(values, dtype=float)) <= LARGEST_NUMBER).all())


def _check_numbers(name: str, word: str, values: Sequence[float], count: int, endless: bool) -> None:
    numbers = np.asarray(values, dtype=float)
    good = not np.isnan(numbers).any() if endless else is_finite(numbers)
    if numbers.shape != (count,) or not good:
        what = "numbers" if endless else "finite numbers"
        raise ModelError(f"{name}: model.{word} must have {count} {what}")
