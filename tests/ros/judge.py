"""Judges what goes out by Pinocchio alone: whether the numbers of a message close the loops."""

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from hybridyn.description.records import Closure
from hybridyn.structure.robot import HybridRobot


def open_by(
    robot: HybridRobot, names: Sequence[str], position: Sequence[float], tree: pin.Model | None = None
) -> float:
    """Return by how much the closures are open: metres and radians together, of hinges and slides alone.

    Args:
        tree: A model of its tree; the robot's own by default.
    """
    model = robot.model if tree is None else tree
    data, at = model.createData(), dict(zip(names, position, strict=True))
    q = np.array([at[name] for name in list(model.names)[1:]])
    pin.framesForwardKinematics(model, data, q)
    couplings = [
        abs(sum(factor * at[joint] for joint, factor in one.terms) - one.offset)
        for one in robot.description.couplings
    ]
    return max([*couplings, *(_open(model, data, closure) for closure in robot.description.closures)])


def _open(model: pin.Model, data: pin.Data, closure: Closure) -> float:
    """Return what is open of what a closure holds, in the frame on its first link."""
    A, B = (
        data.oMf[model.getFrameId(link, pin.BODY)].homogeneous @ frame
        for link, frame in ((closure.link_a, closure.frame_a), (closure.link_b, closure.frame_b))
    )
    X = np.linalg.inv(A) @ B
    shift = np.abs(X[list(closure.translations), 3]).max(initial=0.0)
    turn = {
        "free": 0.0,
        "perpendicular": abs(X[2, 2]),
        "parallel": float(np.linalg.norm(X[:2, 2])),
        "fixed": float(np.linalg.norm(X[:3, :3] - np.eye(3))),
    }[closure.rotation]
    return float(max(shift, turn))
