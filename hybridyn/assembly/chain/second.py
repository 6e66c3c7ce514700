"""Second tasks: what the posture makes least of all those that meet the targets.

A value of the posture is least on the self-motion, which is all that the targets leave open. So positions
depend on the targets alone, on the branch of the row before.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ...description.names import listed
from ...errors import AssemblyError
from ...spatial import Array, Index
from ...structure.module import Module
from ...structure.robot import HybridRobot
from ..free_motions import IDLE
from ..redundancy import LEAST, MIDDLE
from .bodies import ChainMotion
from .least import driven_alone
from .problem import ChainProblem


class Value(Protocol):
    """A number for each posture that is made least."""

    def __call__(self, problem: ChainProblem, q: Array, samples: Index) -> Array:
        """Compute the value at postures, shape (T, nq), of samples of the problem; shape (T,)."""


@dataclass(frozen=True, eq=False)
class FromMiddle:
    """Sum of squares of the motors' ways from the middle of their ranges, each over half its range.

    Attributes:
        at: Coordinate of each motor in the chain, shape (motors,).
        middle: Middle of its range [m or rad].
        half: Half its range, over its weight.
    """

    at: Index
    middle: Array
    half: Array

    def __call__(self, problem: ChainProblem, q: Array, samples: Index) -> Array:
        """Compute the value at postures."""
        out: Array = np.sum(((q[:, self.at] - self.middle) / self.half) ** 2, axis=1)
        return out


@dataclass(frozen=True, eq=False)
class NearSingular:
    """Minus the logarithm of the product of all singular values of two maps, scaled; ranges count, too.

    The maps are those from the free motions of all joints, orthonormal, to the targets and to the motors. The
    first loses rank at serial singularities, the second one, of each module, at parallel ones.

    Attributes:
        motors: Columns of the motors in each part.
        driven: Number of motions of each part that its motors drive.
        ranges: What ways from the middle of ranges add: a motor at a limit as much as a factor e.
    """

    motors: tuple[Index, ...]
    driven: tuple[int, ...]
    ranges: FromMiddle

    def __call__(self, problem: ChainProblem, q: Array, samples: Index) -> Array:
        """Compute the value at postures."""
        split = problem.unweighted.split(problem.matrix(problem.tree.sweep(q), samples))
        maps = [(split.reach, problem.rank)]
        maps += [(N[:, at], r) for N, at, r in zip(split.bases, self.motors, self.driven, strict=True)]
        logarithms = [np.log(np.linalg.svd(x, compute_uv=False)[:, :rank]) for x, rank in maps]
        out: Array = self.ranges(problem, q, samples) - np.concatenate(logarithms, axis=1).sum(axis=1)
        return out


def second_task(
    rule: str,
    robot: HybridRobot,
    modules: Sequence[Module],
    problem: ChainProblem,
    generic: ChainMotion,
    weights: Mapping[str, float],
) -> Value:
    """Return the value that a rule makes least.

    Args:
        rule: Its name, one of `RULES`.
        robot: The robot.
        modules: The modules of the chain.
        problem: Rows and free freedoms.
        generic: Motion at generic postures.
        weights: Motor to the factor of its motion; 1 for others.

    Raises:
        AssemblyError: A motor that may move has no range, or a module moves without its motors.
    """
    for module, part in zip(modules, problem.parts, strict=True):
        if problem.left(part) and not driven_alone(module):
            raise AssemblyError(
                f"redundancy '{rule}': no motor drives some motions of module '{module.name}'; give them, or "
                f"take '{LEAST}'",
                module=module.name,
            )
    middle, endless = _from_middle(robot, modules, problem, weights)
    if rule == MIDDLE:
        if endless:
            raise AssemblyError(
                f"redundancy '{MIDDLE}': motors without a range: {listed(endless)}; give them limits in the "
                "file, or hold them",
                module=modules[-1].name,
            )
        return middle
    split = problem.unweighted.split(problem.matrix(generic))
    motors = tuple(np.array(module.motor_columns, dtype=int) for module in modules)
    driven = tuple(
        int(np.sum(np.linalg.svd(N[0, at], compute_uv=False) > IDLE))
        for N, at in zip(split.bases, motors, strict=True)
    )
    return NearSingular(motors, driven, middle)


def _from_middle(
    robot: HybridRobot, modules: Sequence[Module], problem: ChainProblem, weights: Mapping[str, float]
) -> tuple[FromMiddle, list[str]]:
    """Return the value of the middle of ranges, of all motors that may move, and those without a range."""
    at, middle, half, endless = list[int](), list[float](), list[float](), list[str]()
    for module, part, first in zip(modules, problem.parts, problem.tree.q_of, strict=True):
        starts = {to.start: own.start for to, own in zip(part.tree.v_slices, part.tree.q_slices, strict=True)}
        for name, column in zip(module.motors, module.motor_columns, strict=True):
            joint = robot.records[name]
            if not part.free[column]:
                continue
            if not 0.0 < joint.upper - joint.lower < np.inf:
                endless.append(name)
                continue
            at.append(first.start + starts[column])
            middle.append((joint.upper + joint.lower) / 2)
            half.append((joint.upper - joint.lower) / 2 / weights.get(name, 1.0))
    return FromMiddle(np.array(at, dtype=int), np.array(middle), np.array(half)), endless
