"""Pinocchio: the robot as its reader of URDF sees it, and with constraint models for its closures.

Its algorithms are two solvers for closed loops, `aba` and `rnea` of trees, and `rnea` projected.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

import pinocchio as pin

from ....structure.robot import HybridRobot
from ..methods import Method, grid
from ..peer_engine import NotComparableError, OwnFile, PeerEngine, refuse_other_joints
from .pinocchio_robot import PinocchioEngine, with_constraints
from .pinocchio_solvers import dense, direct, per_module, tree_alone


def ways(robot: HybridRobot, own: OwnFile) -> Iterator[tuple[str, Callable[[], PeerEngine]]]:
    """Yield the ways into Pinocchio: by its reader of URDF, and by constraint models."""
    if own.format == "URDF":
        yield "its URDF reader", partial(_read, robot, own)
    yield "rigid constraints", partial(with_constraints, robot)


def _read(robot: HybridRobot, own: OwnFile) -> PeerEngine:
    """Read the robot's own file with Pinocchio's reader."""
    root = [] if robot.base == "fixed" else [pin.JointModelFreeFlyer()]
    try:
        model = pin.buildModelFromXML(own.text, *root)
    except (RuntimeError, ValueError) as error:
        raise NotComparableError(
            f"Pinocchio's reader refuses it: {' '.join(str(error).split())[:200]}"
        ) from None
    theirs = [str(name) for name in model.names][1:]
    names = theirs if robot.base == "fixed" else [robot.joints[0], *theirs[1:]]
    refuse_other_joints(robot, names, "Pinocchio's reader")
    return PinocchioEngine(robot, model, pin.StdVec_RigidConstraintModel(), "its URDF reader")


#: What is swept of the two solvers for closed loops, both proximal: the sparse Cholesky factors of the KKT
#: matrix, and the loop-constrained articulated body algorithm, of linear cost.
SWEPT = {
    "constraintDynamics": grid(mu=(1e-14, 1e-12, 1e-10, 1e-8, 1e-6, 1e-4, 1e-2), iterations=(1, 2, 3, 5, 10)),
    "lcaba": grid(mu=(1e-8, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1), iterations=(1, 2, 3, 4, 5, 6, 8, 10, 15)),
}
#: Most velocities: Pinocchio's Data holds several nv^3 tensors, 3 GB there.
MOST = 400

METHODS = (
    *(Method(f"pin.{name}", "ddm", partial(direct, name), swept, most=MOST) for name, swept in SWEPT.items()),
    Method("pin.rnea + projection, dense", "idm", dense, most=MOST),
    Method("pin.rnea + projection, per module", "idm", per_module, most=MOST),
    Method("pin.rnea, loops open", "idm", partial(tree_alone, "idm", True), most=MOST),
    Method("pin.aba", "ddm", partial(tree_alone, "ddm", False), most=MOST),
    Method("pin.rnea", "idm", partial(tree_alone, "idm", False), most=MOST),
)
