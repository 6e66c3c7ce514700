"""Refuse Pinocchio models and constraints whose numbers or joints cannot be those of a robot.

The fields of a `pinocchio.Model` can be set to anything; Pinocchio itself may then crash.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from ...errors import ModelError
from ..urdf.xml_node import LARGEST_NUMBER

#: Fields with a number for each freedom or coordinate: which of both, and whether it may be infinite.
NUMBERS = {
    "armature": ("nv", False), "damping": ("nv", False), "friction": ("nv", False),
    "rotorInertia": ("nv", False), "rotorGearRatio": ("nv", False), "effortLimit": ("nv", True),
    "velocityLimit": ("nv", True), "lowerPositionLimit": ("nq", True), "upperPositionLimit": ("nq", True),
}  # fmt: skip
#: Largest difference of R^T R from the identity for a rotation that was rounded in single precision.
ROTATION = 1e-5


def joint_error(model: pin.Model, joint: int, message: str) -> ModelError:
    """Return the error about a joint of a model."""
    name = str(model.names[joint])
    return ModelError(f"Pinocchio model '{model.name}': joint '{name}': {message}", element=name)


def check_model(model: pin.Model) -> None:
    """Check the tree, placements, inertias and numbers of a model.

    Raises:
        ModelError: A joint hangs on one that follows it, or a number is not finite, or out of its range.
    """
    name = f"Pinocchio model '{model.name}'"
    for joint in range(1, model.njoints):
        inertia, problem = model.inertias[joint], ""
        if not 0 <= int(model.parents[joint]) < joint:
            problem = f"hangs on joint {model.parents[joint]}, which does not come before it"
        elif not is_placement(model.jointPlacements[joint]):
            problem = "its placement is not a finite rigid motion"
        elif not is_finite([inertia.mass, *inertia.lever, *np.ravel(inertia.inertia)]) or inertia.mass < 0:
            problem = "mass, lever and inertia must be finite, and the mass not negative"
        if problem:
            raise joint_error(model, joint, problem)
    for frame in model.frames:
        if not is_placement(frame.placement) or not 0 <= int(frame.parentJoint) < model.njoints:
            raise ModelError(
                f"{name}: frame '{frame.name}': its placement is not a finite rigid motion on a joint"
            )
    for word, (count, endless) in NUMBERS.items():
        numbers = np.asarray(getattr(model, word), dtype=float)
        good = not np.isnan(numbers).any() if endless else is_finite(numbers)
        if numbers.shape != (getattr(model, count),) or not good:
            what = "numbers" if endless else "finite numbers"
            raise ModelError(f"{name}: model.{word} must have {getattr(model, count)} {what}")
    if not is_finite(model.gravity.linear):
        raise ModelError(f"{name}: its gravity is not finite")


def is_placement(placement: pin.SE3) -> bool:
    """Say whether a placement is finite and its rotation is one, up to single precision."""
    R = np.array(placement.rotation)
    if not is_finite(placement.homogeneous) or np.abs(R).max() > 2:
        return False
    return bool(np.abs(R.T @ R - np.eye(3)).max() < ROTATION and np.linalg.det(R) > 0)


def is_finite(values: Any) -> bool:
    """Say whether all numbers are as small as those of a file have to be."""
    return bool((np.abs(np.asarray(values, dtype=float)) <= LARGEST_NUMBER).all())
