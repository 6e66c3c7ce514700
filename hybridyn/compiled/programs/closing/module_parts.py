"""Modules to close: what is prescribed in them, their numbers at postures, and limits of their kernels."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from ....assembly.module_request import ModuleRequest
from ....assembly.walk import MOST_TURNING
from ....linkage.angles import angles_of
from ....linkage.reduction import LegBlock
from ....spatial import Array, Index
from ....structure.module import Module
from ....structure.robot import HybridRobot
from .extended import extended
from .given import ANGLE, POSE, WIDTH, Given, numbers_of

if TYPE_CHECKING:
    from ...equations.idle.motion import IdleMotion


#: No part keeps anything.
NOTHING: Mapping[int, int] = MappingProxyType({})
#: Largest residual of closed loops, without units: rounding. Rows that contradict each other by more are for
#: the general path.
CLOSED_TO_ROUNDING = 1e-13
#: Largest rounding of over-determined closures in the robot's file. Above it they can only be met in the
#: least-squares sense, which elimination with pivots cannot do.
CONTRADICTING_FILE = 1e-12
#: Newton steps below this (rad, module lengths) are followed by the rates: the next step is its square, which
#: is below the limits of a last step and of its residual.
QUADRATIC = 3e-7
#: Largest last step: the rates before it are those after it to rounding.
LAST_ROW_STEP = 2e-13
#: Largest bound t of |J'^-1 (J' - J)|: then |J^-1 (J' - J)| <= t / (1 - t) is within `MOST_TURNING`, and a
#: tenth is left to rounding.
MOST_BOUND = 0.9 * MOST_TURNING / (1.0 + MOST_TURNING)
#: Most Newton steps from row to row, and from a guess.
ITERATIONS, PATIENCE = 12, 60
#: Most free freedoms of a module: its kernels grow with their cube.
MOST_FREEDOMS = 60


def upright_is_meant(parts: Sequence[Part], q: Array, known: Array, *, met: bool) -> bool:
    """Return whether one or two angles are meant of the upright triple, the only one that kernels know.

    Args:
        parts: The modules.
        q: A closed posture of the spanning tree, shape (nq,).
        known: What is prescribed next, shape (numbers,).
        met: Whether the posture has it.
    """
    at, first = 0, np.zeros(1, dtype=int)
    for part in parts:
        at += sum(WIDTH[kind] for kind in part.given.kinds) + WIDTH[POSE] * len(part.given.bodies)
        for some in part.given.coordinates:
            own = known[None, at : at + len(some.names)]
            at += len(some.names)
            if some.kinds.count(ANGLE) not in (1, 2):  # three are a rotation
                continue
            m = part.module.mechanism
            motion = m.tree.sweep(m.cut.positions(q[None, part.module.q_index]))
            target = some.target._replace(value=own)
            target = target.headed_at(motion, own) if met else target.headed(motion, first)
            upright = angles_of(target.axes(motion))[:, 2]
            if target.heading is not None and np.cos(target.heading - upright)[0] < 0.0:
                return False
    return True


@dataclass(frozen=True)
class Part:
    """A module to close.

    Attributes:
        module: The module.
        given: What is prescribed in it.
        blocks: Blocks of its free freedoms (`LoopProblem.blocks`).
        idle: Idle motions that are left open: their rates are the least.
    """

    module: Module
    given: Given
    blocks: Sequence[LegBlock]
    idle: tuple[IdleMotion, ...] = ()

    @property
    def shape(self) -> tuple[object, ...]:
        """What parts have in common that the same kernels may close."""
        return extended(self.module.mechanism).shape, self.given, tuple(motion.key for motion in self.idle)

    @property
    def idle_freedoms(self) -> list[int]:
        """Freedoms of the tree after the cuts that stand for its idle motions."""
        return [motion.col for motion in self.idle]

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


def posture_of(parts: Sequence[Part], q: Array) -> tuple[Array, Array, Array]:
    """Return a posture of the spanning tree, shape (nq,), its platforms, and what is prescribed there."""
    cut = [part.module.mechanism.cut.positions(q[None, part.module.q_index]) for part in parts]
    p, g = places_at(parts, cut, 1)
    return q, p[0], g[0]


def kinds_of(
    robot: HybridRobot, parts: Sequence[Part], chains: Sequence[Given] = (), kept: Mapping[int, int] = NOTHING
) -> dict[str, tuple[int, list[Index]]]:
    """Return the numbers of each kind: how many there are, and those of each part, then of each chain.

    Args:
        chains: What chains prescribe.
        kept: Number of numbers that a part in a chain keeps from a start, by the part.
    """

    def after(sizes: list[int]) -> tuple[int, list[Index]]:
        """Return entries that lie one part after the other, by their number in each."""
        ends = np.cumsum([0, *sizes])
        return int(ends[-1]), [np.arange(start, end) for start, end in pairwise(ends.tolist())]

    return {
        "q": (robot.nq, [part.module.q_index for part in parts]),
        "v": (robot.nv, [part.module.v_index for part in parts]),
        "p": after([part.platforms for part in parts]),
        "g": after([given.size for given in (*(part.given for part in parts), *chains)]),
        "rates": after([given.rates for given in (*(part.given for part in parts), *chains)]),
        "each": after([1] * len(parts)),
        "kept": after([kept.get(k, 0) for k in range(len(parts))]),
    }


def lanes_for(parts: Sequence[Part]) -> int:
    """Return the lanes that equal modules fill, at least 2: rows come one by one, so more would be idle."""
    equal = Counter((extended(part.module.mechanism).shape, part.given) for part in parts)
    return 1 << max(1, (max(equal.values()) - 1).bit_length())


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


def numbers(parts: list[Part], wanted: list[ModuleRequest]) -> tuple[Array, Array, Array]:
    """Return what is prescribed, its rates and accelerations, shapes (T, numbers), (T, rates), (T, rates)."""
    each = [numbers_of(request, part.given) for part, request in zip(parts, wanted, strict=True)]
    g, g_dot, g_ddot = (np.concatenate(level, axis=1) for level in zip(*each, strict=True))
    return g, g_dot, g_ddot
