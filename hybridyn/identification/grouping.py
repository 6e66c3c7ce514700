"""Base parameters counted by Khalil's grouping rules: joint by joint, leg by leg, closure by closure.

A body's kinetic energy is that of point masses: 2 T = sum P_ij (H x_i)_dot . (H x_j)_dot, where H is its
pose, x are its vectors (three directions, and the origin), and P is its pseudo-inertia, another form of its
ten numbers. Two bodies that are joined share vectors: at a hinge its axis and a point on it, at a slide all
directions, at a ball its centre. The part of P over shared vectors may belong to either body: three numbers
at a hinge, six at a slide, one at a ball (Khalil and Dombre 2002, chapter 9). It belongs to nobody where the
vectors rest in the world. A body that turns about a direction at rest has one moment of inertia. Bodies that
parallelograms keep parallel share all directions.

The count is the rank at random values of the vectors that obey these rules and nothing else: what a loop does
beyond them is not in it.
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from ..effects.choice import Choice
from ..spatial import Array
from ..structure.robot import HybridRobot
from ..threads import one_thread
from .base_parameters import RANK, BaseParameters, base_parameters, units
from .vectors import RELATED, Vectors


@dataclass(frozen=True, eq=False)
class Grouping:
    """The count of base parameters by the grouping rules, and why the numerical one may be smaller.

    Attributes:
        rank: Number of base parameters by the rules.
        numerical: Number of base parameters over random states (`base_parameters`).
        rules: What each joint and closure allows, one sentence each.
        loops: Which loops make the numerical number smaller, one sentence; empty if none does.
    """

    rank: int
    numerical: int
    rules: tuple[str, ...]
    loops: str


@one_thread()
def grouping(robot: HybridRobot, *, effects: Choice = None, symmetric: bool = False) -> Grouping:
    """Count the base parameters by the grouping rules, and compare with the numerical count.

    Args:
        robot: The robot.
        effects: As in `regressor`.
        symmetric: As in `regressor`.
    """
    base = base_parameters(robot, effects=effects, symmetric=symmetric)
    vectors = Vectors(robot)
    rows = vectors.rows(base.standard)
    rank = int(np.linalg.matrix_rank(rows, rtol=RANK)) if rows.size else 0
    loops = _loops(base, robot, rows) if rank != base.rank else ""
    return Grouping(rank, base.rank, tuple(vectors.rules), loops)


def _loops(base: BaseParameters, robot: HybridRobot, rows: Array) -> str:
    """Say which loops tie parameters that the rules leave apart; empty if there are none."""
    parameters = base.standard
    null = scipy.linalg.null_space(base.combination * units(robot, parameters), rcond=RANK)
    _, sizes, Vt = np.linalg.svd(rows @ null)
    tied = null @ Vt[: int((sizes > RELATED * np.abs(rows).max(initial=1.0)).sum())].T
    felt = np.abs(tied).max(axis=1, initial=0.0) > RELATED
    named = []
    for module in robot.modules:
        bodies = {robot.body_of_joint[joint] for joint in module.joints}
        own = [np.zeros(0, dtype=int), *(at for body, at in parameters.bodies.items() if body in bodies)]
        own += [term.columns[np.isin(term.joints, module.joints)] for term in parameters.terms]
        if module.closures and felt[np.concatenate(own)].any():
            named.append(f"'{module.name}' (closed by {', '.join(module.closures)})")
    if not tied.shape[1]:
        return ""
    which = f"the loops of {' and of '.join(named)} tie" if named else "joints tie"
    return f"{tied.shape[1]} fewer: {which} vectors of bodies that the rules leave apart"
