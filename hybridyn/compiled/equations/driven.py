"""The motors of a module, which balance the forces along its motions, and friction that grows with load."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, reduce
from typing import Any

import casadi as ca
import numpy as np

from ...symbols import Expression, dot, minus, plus
from .chains import Chain
from .core import Core
from .expressions import zeros
from .guarded_elimination import Pivots
from .module_plan import ModulePlan
from .motor_balance import motor_efforts
from .options import Options
from .rubbing import answers_of, answers_of_core, pushed_by
from .rubbing_joints import Rubbing, of_core, with_arguments
from .rubbing_legs import read_legs
from .settling import settle
from .stages import GivenColumns


def motor_columns(core: Core, plan: ModulePlan, options: Options, received: GivenColumns) -> Expression:
    """Compute the forces over y of unit efforts of the motors, shape (n, motors)."""
    parts, out = plan.parts, zeros(core.chain.nv, len(options.motors))
    place = {int(col): k for k, col in enumerate(parts.tree_v)}
    for j, col in enumerate(options.motors):
        if col in place:
            out[place[col], j] = 1.0
    for n, (group, driven) in enumerate(zip(parts.groups, driven_of_legs(plan, options), strict=True)):
        if not driven:
            continue
        at = np.array(core.chain.columns_of(group[0].platform + 1)) - 6
        entries = received.take(f"motors {n}", len(group) * len(driven) * 6)
        wrenches = entries.reshape(len(group), len(driven), 6)
        for i, leg in enumerate(group):
            for j, k in enumerate(driven):
                out[at, options.motors.index(int(leg.tree_v[k]))] = wrenches[i, j]
    return out


def driven_of_legs(plan: ModulePlan, options: Options) -> list[list[int]]:
    """Return the freedoms that are driven, numbered inside the leg, by group of legs."""
    return [group[0].among(options.motors) for group in plan.parts.groups]


@dataclass(eq=False)
class Driven:
    """The motors of a module, which balance the forces along its motions.

    Attributes:
        plan, options: As in `write_inverse`.
        columns: Forces over y of unit efforts of the motors, shape (n, motors).
        X: The core's motions, shape (n, motions), idle ones first.
        terms: The terms of the forces along its motions, as work per scaled coordinate.
        pivots: Pivots of the motor map.
    """

    plan: ModulePlan
    options: Options
    columns: Expression
    X: Expression
    terms: list[Any]
    pivots: Pivots | None

    @cached_property
    def size(self) -> Any:
        """Size of the terms."""
        return reduce(plus, map(ca.fabs, self.terms), ca.SX(0.0))

    @cached_property
    def motor_map(self) -> Expression:
        """The work B of each motor along each motion, shape (N, motors)."""
        return dot(self.X[:, self.plan.idle :].T, self.columns)

    def efforts(self, forces: Expression) -> tuple[Expression, Any]:
        """Return the efforts that balance forces over y, and their guard."""
        plan, parts, moving = self.plan, self.plan.parts, list(self.options.moving)
        tau = zeros(len(self.options.motors))
        units = plan.mechanism.reduction.col_scale[parts.tree_v[plan.motions[plan.idle :]]]
        terms = (self.size, units, plan.scale)
        Q, share = dot(self.X[:, plan.idle :].T, forces), np.array(self.options.share)
        tau[moving], measure = motor_efforts(self.motor_map[:, moving], Q, terms, share, self.pivots)
        return tau, measure

    def balances(self, one: Rubbing) -> bool:
        """Return whether a motor on a joint balances all its friction, which no other force then answers."""
        moving = {self.options.motors[i] for i in self.options.moving}
        return not self.options.share and self.pivots is not None and moving.issuperset(one.cols)

    def with_friction(
        self, core: Core, motion: tuple[Chain, Expression], b: Expression, outputs: list[Expression],
        received: GivenColumns,
    ) -> tuple[Expression, Expression, Any]:  # fmt: skip
        """Return required forces over s with friction that grows with load, that friction, and its guard.

        Args:
            motion: The core's motion for inertial forces, and the rates of the spanning tree.
            b, outputs: As of `required_forces`.
            received: Filled with what legs tell.
        """
        plan, rubbing, motors = self.plan, self.options.rubbing, self.options.motors
        legs = read_legs(received, rubbing, plan.parts, [*map(len, driven_of_legs(plan, self.options))])
        pushed = pushed_by(rubbing, core, plan, motion[1], [own for _, own in legs])
        felt = [0, *(1 + j for j, one in enumerate(rubbing) if not self.balances(one))]
        needed = np.concatenate([b[6:, None], pushed[6:]], axis=1)
        tau, left = zeros(len(motors), len(needed.T)), zeros(*needed.shape)
        for j in felt:
            tau[:, j] = self.efforts(needed[:, j])[0]
            left[:, j] = minus(needed[:, j], dot(self.columns, tau[:, j]))
        own = of_core(rubbing, plan.parts)
        rows = [answers_of_core(core, plan, own, motion[0], outputs, left)]
        for leg, answers in legs:
            each = answers.taken_of(tau[[motors.index(int(leg.tree_v[k])) for k in leg.among(motors)]])
            balanced = [1 + j for j in answers.at if 1 + j not in felt]
            each[:, balanced] = 0.0
            rows.append(each)
        n, guard = settle(
            with_arguments(rubbing, plan.column), answers_of(rubbing, np.concatenate(rows)), plan.scale.eps
        )
        return plus(b, dot(pushed, n)), n, guard
