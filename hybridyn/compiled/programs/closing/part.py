"""A module as one part of a closing program, and the limits of such programs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ....assembly.follow import MOST_TURNING
from ....linkage.reduction import Block
from ....spatial import Array
from ....structure.module import Module
from ....structure.robot import HybridRobot
from .extended import extended
from .given import Given

if TYPE_CHECKING:
    from ...equations.spins import Spin

#: Largest residual of closed loops, without units: rounding. Rows that contradict each other by more are for
#: the general path.
CLOSED_TO_ROUNDING = 1e-13
#: Largest rounding of over-determined closures in the robot's file. Above it they can only be met in the
#: least-squares sense, which elimination with pivots cannot do.
CONTRADICTING_FILE = 1e-12
#: Newton steps below this (rad, module lengths) are followed by the rates: the next step is its square.
QUADRATIC = 1e-6
#: Largest last step: the rates before it are those after it to rounding.
LAST_ROW_STEP = 2e-13
#: Largest bound t of |J'^-1 (J' - J)|: then |J^-1 (J' - J)| <= t / (1 - t) is within `MOST_TURNING`, and a
#: tenth is left to rounding.
MOST_BOUND = 0.9 * MOST_TURNING / (1.0 + MOST_TURNING)
#: Most Newton steps from row to row, and from a guess.
ITERATIONS, PATIENCE = 12, 60
#: Most free freedoms of a module: its kernels grow with their cube.
MOST_FREEDOMS = 60


@dataclass(frozen=True)
class Part:
    """A module to close.

    Attributes:
        module: The module.
        given: What is prescribed in it.
        blocks: Blocks of its free freedoms (`LoopProblem.blocks`).
        spins: Idle spins that are left open: their rates are the least.
    """

    module: Module
    given: Given
    blocks: Sequence[Block]
    spins: tuple[Spin, ...] = ()

    @property
    def platforms(self) -> int:
        """Number of the platforms' coordinates."""
        return 7 * len(self.module.mechanism.spec.platforms)


def places_at(parts: Sequence[Part], postures: Sequence[Array], samples: int) -> tuple[Array, Array]:
    """Compute the coordinates of all platforms and what is prescribed, at postures of each part.

    Args:
        postures: Positions of the tree after the cuts of each part, shape (T, its nq).
        samples: Number T.

    Returns:
        Shapes (T, platforms), (T, numbers).
    """
    platforms, given = [np.zeros((samples, 0))], [np.zeros((samples, 0))]
    for part, x in zip(parts, postures, strict=True):
        m = part.module.mechanism
        platforms += [x[:, m.tree.q_slices[i]] for i in m.spec.platforms]
        given.append(part.given.of_posture(m.tree, x))
    return np.concatenate(platforms, axis=1), np.concatenate(given, axis=1)


def lanes_for(parts: Sequence[Part]) -> int:
    """Return the lanes that equal modules fill, at least 2: rows come one by one, so more would be idle."""
    equal = Counter((extended(part.module.mechanism).shape, part.given) for part in parts)
    lanes = 2
    while lanes < max(equal.values()):
        lanes *= 2
    return lanes


def motors_given(robot: HybridRobot, parts: Sequence[Part]) -> list[int]:
    """Return the motor of each prescribed number; empty if other numbers than the motors' are prescribed."""
    number = {name: i for i, name in enumerate(robot.motors)}
    order = []
    for part in parts:
        source = part.module.mechanism.spec.tree_joint
        joints = [source[joint] for joint in part.given.joints]
        order += [number.get(part.module.joints[i], -1) if i is not None else -1 for i in joints]
        order += [-1] * (len(part.given.all_kinds) - len(joints))
    return order if sorted(order) == list(range(len(robot.motors))) else []
