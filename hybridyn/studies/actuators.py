"""What simulators of serial joints need of a parallel ankle: its motors as if they sat at pitch and roll.

At a posture, with H = d(motors)/d(joints), G = d(joints)/d(motors), and the numbers of the motors:

    armature   diag(H^T diag(rotors) H)           inertia that the joint feels
    damping    diag(H^T diag(damping) H)
    gain       diag(H^T H)                        stiffness where each motor has a position gain of 1
    alone      min over motors of limit/|G|       largest effort of one joint while the others have none
    most       sum over motors of |H| limit       largest effort of one joint, whatever the others have
    coupling   largest |A_ij| / sqrt(A_ii A_jj)   of the armature: what numbers by joint leave out

One number for all postures is the middle of their range, of efforts the least. Its error is its distance
from the farthest posture's, over the number itself.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..dynamics.quantities.joint_map import JointMap
from ..effects.joint_laws import RotorInertia, ViscousFriction
from ..spatial import Array

#: What is computed where all postures have it.
UNITS = {"armature": "kg m^2", "damping": "N m s/rad", "gain": "1", "alone": "N m", "most": "N m"}


class ConstantActuator(NamedTuple):
    """One number for a joint over all postures.

    Attributes:
        joint: Name of the joint.
        what: One of `UNITS`, or "coupling".
        value: The number.
        error: Largest difference from it, over it.
    """

    joint: str
    what: str
    value: float
    error: float


def actuator_columns(found: JointMap) -> dict[str, Array]:
    """Return the numbers of the joints at each posture of a map, shape (T,), by `JOINT/what`.

    Those of rotors, damping and limits are left out where the robot's files state none.
    """
    H, G, robot = found.motors_per_joints, found.joints_per_motors, found.robot
    rotors, damping = (
        np.array([stated.get(motor, (0.0,))[0] for motor in found.motors])
        for stated in (RotorInertia().numbers(robot), ViscousFriction().numbers(robot))
    )
    limit = np.array([robot.records[motor].effort_limit for motor in found.motors])
    A = found.at_joints(rotors)
    every = {"armature": A, "damping": found.at_joints(damping), "gain": found.at_joints(np.ones(len(limit)))}
    out = {f"{joint}/position": found.joint_positions[:, j] for j, joint in enumerate(found.joints)}
    for j, joint in enumerate(found.joints):
        out |= {f"{joint}/{what}": x[:, j, j] for what, x in every.items() if x.any()}
        if np.isfinite(limit).all():
            with np.errstate(divide="ignore"):  # a motor that this joint does not load
                out[f"{joint}/alone"] = (limit / np.abs(G[:, j])).min(axis=1)
            out[f"{joint}/most"] = np.abs(H[:, :, j]) @ limit
        if A.any() and len(found.joints) > 1:
            size = np.sqrt(np.einsum("tii->ti", A))
            share = np.abs(A[:, j]) / (size[:, [j]] * size)
            out[f"{joint}/coupling"] = np.delete(share, j, axis=1).max(axis=1)
    return out


def constants(columns: dict[str, Array]) -> list[ConstantActuator]:
    """Return the numbers that do not depend on the posture, and the errors that they make.

    Args:
        columns: Those of `actuator_columns`.
    """
    out = []
    for name, x in columns.items():
        joint, _, what = name.rpartition("/")
        if what in UNITS:
            low, high = float(x.min()), float(x.max())
            value = low if what in ("alone", "most") else (low + high) / 2
            out.append(ConstantActuator(joint, what, value, max(high - value, value - low) / value))
        elif what == "coupling":
            out.append(ConstantActuator(joint, what, float(x.max()), float("nan")))
    return out
