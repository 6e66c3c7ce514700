"""Numbers of a joint of a Pinocchio model: limits, friction, damping, armature, rotor."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from ...errors import ModelError
from ..records import Array, JointKind

#: Limits of this size or more are those of a joint without limit: Pinocchio fills in the largest float.
UNLIMITED = 1e300


def joint_error(model: pin.Model, joint: int, message: str) -> ModelError:
    """Return the error about a joint of a model."""
    name = str(model.names[joint])
    return ModelError(f"Pinocchio model '{model.name}': joint '{name}': {message}", element=name)


def numbers_of(model: pin.Model, joint: int, freedom: int) -> dict[str, Any]:
    """Return limits, friction and rotor of one freedom of a joint, as arguments of `records.Joint`.

    Armature is what Pinocchio's algorithms add to the mass matrix. It becomes the rotor's inertia, unless
    rotor inertia and gear ratio of the model state the same armature.
    """
    at = int(model.idx_vs[joint]) + freedom
    inertia, ratio = float(model.rotorInertia[at]), float(model.rotorGearRatio[at])
    armature = float(model.armature[at])
    if armature != inertia * ratio**2 and (armature or not (inertia and ratio)):
        inertia, ratio = armature, 1.0
    damping, friction = float(model.damping[at]), float(model.friction[at])
    for word, value in (("armature", inertia), ("damping", damping), ("friction", friction)):
        if value < 0:
            raise joint_error(model, joint, f"negative {word} {value:g}; set it to 0 or more")
    out: dict[str, Any] = {
        "damping": damping,
        "friction": friction,
        "rotor_inertia": inertia,
        "gear_ratio": ratio or 1.0,
        "velocity": _bound(model.velocityLimit[at]),
        "effort": _bound(model.effortLimit[at]),
    }
    if int(model.nqs[joint]) == int(model.nvs[joint]):  # no cosines and sines among the coordinates
        place = int(model.idx_qs[joint]) + freedom
        lower, upper = (float(x[place]) for x in (model.lowerPositionLimit, model.upperPositionLimit))
        if lower < upper:
            out |= {"lower": -_bound(-lower), "upper": _bound(upper)}
    return out


def numbers_of_all(model: pin.Model, joint: int, kind: JointKind) -> dict[str, Any]:
    """Return damping and, of a ball, rotor of a joint with several freedoms; refuse what it cannot have here.

    Raises:
        ModelError: Its freedoms differ in damping or armature, or have dry friction, rotors or, unless it is
            a ball, armature.
    """
    at = slice(int(model.idx_vs[joint]), int(model.idx_vs[joint]) + int(model.nvs[joint]))
    for word in ("friction", "rotorInertia", *(["armature"] if kind != "spherical" else [])):
        if np.any(getattr(model, word)[at]):
            raise joint_error(
                model, joint, f"{word} of a joint with several freedoms is not read; set model.{word} to 0"
            )
    for word in ("damping", "armature"):
        of_all: Array = np.asarray(getattr(model, word)[at])
        if np.ptp(of_all) or of_all[0] < 0:
            message = f"the freedoms of one joint have different {word}; set model.{word} to one value"
            raise joint_error(model, joint, message)
    first = at.start
    return {"damping": float(model.damping[first]), "rotor_inertia": float(model.armature[first])}


def _bound(value: float) -> float:
    """Return a limit, infinite where the model states none."""
    return float(value) if 0 <= value < UNLIMITED else np.inf if value >= 0 else float(value)
