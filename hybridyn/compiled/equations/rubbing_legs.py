"""Friction that grows with load at joints of a group's legs.

The closure at a leg's end has to produce some forces along the leg's joints, `left`. For these the platform
acts on the leg by X^T left at the closure's point. So a joint transmits what its child and the bodies that
this carries require, less that, and the law takes from it

    p = required + through left
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import casadi as ca
import numpy as np

from ...effects.load_friction import against
from ...spatial import cross, numpy_on_symbols
from ...symbols import Expression, dot, minus, plus
from .expressions import filled, zeros
from .leg_groups import Leg
from .legs import WrittenLeg
from .parts import Parts
from .rubbing_joints import Rubbing, of_core, of_legs, with_arguments
from .stages import GivenColumns


class RubbingLeg(NamedTuple):
    """The joints of a group's legs that rub, in the numbers that the legs share.

    Attributes:
        joints: Numbers of the joints, of the first leg.
        parts: What the terms of each take from its wrench, shape (rows, 6).
        through: What all terms take per force along the leg's joints, shape (rows, nv).
        efforts: Efforts along the leg's joints per unit of each friction, shape (nv, joints).
        pushes: Wrenches on the platform that these cause, in the base's frame, shape (6, joints).
    """

    joints: list[int]
    parts: list[Expression]
    through: Expression
    efforts: Expression
    pushes: Expression

    @classmethod
    def of(
        cls,
        leg: WrittenLeg,
        group: Sequence[Leg],
        rubbing: Sequence[Sequence[Rubbing]],
        v: Expression,
        column: ca.SX | None,
    ) -> RubbingLeg:
        """Return the joints that rub.

        Args:
            leg: The legs.
            rubbing: Those of each leg.
            v: Rates of the leg.
            column: Symbols of all arguments, or None without any.
        """
        rubbing = [with_arguments(own, column) for own in rubbing]
        own, folding, chain = group[0].tree_v.tolist(), leg.folding, leg.chain
        parts, through, efforts = list[Expression](), [zeros(0, len(v))], zeros(len(v), len(rubbing[0]))
        for j, each in enumerate(zip(*rubbing, strict=True)):
            body, at = each[0].joint + 1, [own.index(col) for col in each[0].cols]
            part = folding.array([np.concatenate([term.part for term in one.terms]) for one in each])
            force, moment = (dot(x, chain.R0[body].T) for x in (part[:, :3], part[:, 3:]))
            arm = minus(leg.point, chain.p0[body])
            lines = np.concatenate([plus(force, cross(moment, arm[None])), moment], axis=1)
            parts, through = [*parts, part], [*through, -dot(lines, leg.X.T)]
            rise, speed, width = folding.array([filled(one[3:], 3) for one in each])
            with numpy_on_symbols():
                efforts[at, j] = against(v[at], width, rise, speed)
        pushes = np.stack([leg.wrench(x) for x in dot(leg.X.T, efforts).T], axis=1)
        return cls([one.joint for one in rubbing[0]], parts, np.concatenate(through), efforts, pushes)

    def required(self, of_bodies: Mapping[int, Expression]) -> Expression:
        """Return what the terms take from what children and what these carry require, shape (rows, ...).

        Args:
            of_bodies: That of each body, in its frame, shape (6, ...).
        """
        each = zip(self.parts, self.joints, strict=True)
        return np.concatenate([dot(part, of_bodies[joint + 1]) for part, joint in each])

    def of_frictions(self) -> Expression:
        """Return what the terms take per unit of each friction, besides what its motion causes."""
        return -dot(self.through, self.efforts)


class LegAnswers(NamedTuple):
    """What one leg tells of its joints that rub.

    Attributes:
        alone: What the law takes from their wrenches without further forces, shape (rows,).
        per_force: The same per effort of each motor (inverse model), or per [V_dot_base; delta] (direct
            model), shape (rows, k).
        per_unit: The same per unit of each friction, besides what its motion causes, shape (rows, joints).
        pushes: Wrenches along delta that these cause, base's frame, shape (6, joints).
        at: Where its frictions are among those of the module.
        platform: The joint of its platform.
    """

    alone: Expression
    per_force: Expression
    per_unit: Expression
    pushes: Expression
    at: list[int]
    platform: int

    def taken_of(self, force: Expression) -> Expression:
        """Return what the law takes from its wrenches, alone and per unit of each of the module's frictions.

        Args:
            force: What `per_force` is per, alone and per unit of each friction, shape (k, 1 + joints).
        """
        out = dot(self.per_force, force)
        out[:, 0] = plus(out[:, 0], self.alone)
        at = [1 + j for j in self.at]
        out[:, at] = plus(out[:, at], self.per_unit)
        return out


def read_legs(
    received: GivenColumns, rubbing: Sequence[Rubbing], parts: Parts, forces: Sequence[int]
) -> list[tuple[Leg, LegAnswers]]:
    """Read what legs tell, with the legs that have joints that rub.

    Args:
        received: Filled with the columns.
        forces: The number of columns of `LegAnswers.per_force`, by group.
    """
    out = list[tuple[Leg, LegAnswers]]()
    at = len(of_core(rubbing, parts))
    for n, (group, each) in enumerate(zip(parts.groups, of_legs(rubbing, parts), strict=True)):
        if not each[0]:
            continue
        J, rows = len(each[0]), sum(len(term.part) for one in each[0] for term in one.terms)
        shapes = (rows,), (rows, forces[n]), (rows, J), (6, J)
        ends = np.cumsum([np.prod(shape, dtype=int) for shape in shapes])
        column = received.take(f"rubbing {n}", len(group) * int(ends[-1]))
        for leg, own in zip(group, column.reshape(len(group), -1), strict=True):
            numbers_of = zip(np.split(own, ends[:-1]), shapes, strict=True)
            told = [values.reshape(shape) for values, shape in numbers_of]
            out.append(
                (leg, LegAnswers(told[0], told[1], told[2], told[3], [*range(at, at + J)], leg.platform))
            )
            at += J
    return out
