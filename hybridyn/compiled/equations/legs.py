"""Write the kinematics and dynamics of one group of equal legs, once for the group.

A leg's joint accelerations follow from that of the platform relative to the base, delta = V_dot_platform -
V_dot_base,

    q_ddot = X [delta at the closure's point] + y_0

so the leg acts on the module only through its inertia over [V_dot_base; delta]. Nothing drives its idle
motion, if it has one (`idle.legs`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from operator import add
from typing import Any

import casadi as ca
import numpy as np

from ...linkage.closure_rows import Directions, closed_directions, drift_of, rows_of, turns_dot
from ...spatial import Array, rotate, wrench_to_base
from ...symbols import Expression, dot, minus, plus
from .chains import Chain, own_columns, point_acceleration, point_velocity, sweep
from .expressions import Folding, along, numbers, pack, sampled, symbols, zeros
from .guarded_elimination import Pivots, choose_pivots, solve
from .idle.legs import LegIdle, other_rates
from .leg_groups import Leg
from .module_plan import ModulePlan
from .own_axes import own_positions, own_rates
from .rigid import BallAxes, Links
from .scales import Scale, squares, weighed


@dataclass
class PlatformMotion:
    """Motion of a platform in the base's frame, as its legs need it.

    Attributes:
        R, p: Axes and origin in the base.
        V: Twist, in the base's frame.
        rate_weight: Weight of squared closure residuals of rates (`scales.Scale.weight`).
        A: Acceleration less gravity, in the base's frame, for the inverse model; else zeros.
        acceleration_weight: As `rate_weight`, of accelerations.
    """

    R: Expression
    p: Expression
    V: Expression
    rate_weight: Any
    A: Expression = field(default_factory=lambda: zeros(6))
    acceleration_weight: Any = None

    def column(self) -> ca.SX:
        """Return the motion as one column, as `read` takes it."""
        motion = (self.R, self.p, self.V, [self.rate_weight])
        return (
            pack(*motion)
            if self.acceleration_weight is None
            else pack(*motion, self.A, [self.acceleration_weight])
        )

    @classmethod
    def read(cls, p: Expression) -> PlatformMotion:
        """Return the motion from the entries of its column."""
        return cls(p[:9].reshape(3, 3), p[9:12], p[12:18], p[18], *((p[19:25], p[25]) if len(p) > 19 else ()))


@dataclass
class WrittenLeg:
    """A leg in expressions: its motion, and its joint rates as functions of its platform's motion.

    Attributes:
        folding: The numbers in which the legs differ.
        q: Positions, in its own axes.
        chain: Its motion, including that of the base.
        point: The closure's point in the base's frame, shape (3,).
        X: Joint rates over the relative motion [v, w] of the closure's point, base axes, shape (nv, 6).
        y0: Joint accelerations at delta = 0, shape (nv,); not of a leg with accelerations.
        idle: Its idle motion, or None; X and y0 have none of it.
    """

    folding: Folding
    q: Expression
    chain: Chain
    point: Expression
    X: Expression
    y0: Expression
    idle: LegIdle | None
    guard: ca.SX

    def wrench(self, F: Expression) -> Expression:
        """Transform a wrench at the closure's point to the base's frame, shape (6,)."""
        return wrench_to_base(numbers(np.eye(3)), self.point, F)

    def guarded(self, plan: ModulePlan) -> ca.SX:
        """Return its guard; with arguments, that its idle motion is idle, too."""
        if self.idle is None or plan.column is None:
            return self.guard
        return ca.SX(self.guard + self.idle.guard(plan, self.chain.links))


def fold_links(folding: Folding, copies: Sequence[Links]) -> Links:
    """Return links whose numbers represent those of all copies, by the joints of the first."""
    return {
        i: replace(
            same[0],
            R=folding.array([link.R for link in same]),
            p=folding.array([link.p for link in same]),
            inertia=folding.array([link.inertia for link in same]),
            ball=BallAxes(*(folding.array([*x]) for x in zip(*balls, strict=True))) if balls else None,
        )
        for i, *same in zip(copies[0], *(links.values() for links in copies), strict=True)
        for balls in [[link.ball for link in same if link.ball]]
    }


def _frames(folding: Folding, group: tuple[Leg, ...]) -> list[Expression]:
    """Return the closure's frames: axes and origin on the leg, axes and origin on the platform."""
    sides = [("R_a", "p_a", "R_b", "p_b") if leg.on_a else ("R_b", "p_b", "R_a", "p_a") for leg in group]
    return [
        folding.array([getattr(leg.closure, side[k]) for leg, side in zip(group, sides, strict=True)])
        for k in range(4)
    ]


def _rows(chain: Chain, end: int, point: Expression, directions: Directions) -> Expression:
    """Compute the rows of a closure over the rates of a leg, in the axes of its body, shape (rows, nv)."""
    own, columns = own_columns(chain, end), zeros(6, chain.nv)
    for k, column in own.items():
        columns[:, k] = np.concatenate([point_velocity(column, point), column[3:]])
    return rows_of(directions, (columns[:3].T, columns[3:].T))


def write_leg(
    group: tuple[Leg, ...], q: Expression, v: Expression, base: tuple[Expression, Expression],
    platform: PlatformMotion, scale: Scale, pivots: Pivots, a: Expression | None = None,
) -> WrittenLeg:  # fmt: skip
    """Write the kinematics of a group's legs.

    Args:
        q: Positions of the leg.
        base: Twist of the base, and its acceleration less gravity if accelerations are given; own frame.
        platform: Motion of the platform.
        scale: Scales of closure residuals.
        pivots: Pivots of the leg's closure.
        a: Accelerations of the leg, for the inverse model. They then have to close the loop.
    """
    folding, leg = Folding(), group[0]
    links = fold_links(folding, [leg.links for leg in group])
    R_s, p_s, R_o, p_o = _frames(folding, group)
    q, own_a = own_positions(links, q), None if a is None else own_rates(links, a)
    chain = sweep(links, q, own_rates(links, v), base[0], own_a, None if a is None else base[1])
    R0, V, c = chain.R0[leg.end], chain.V[leg.end], chain.c[leg.end]
    point = plus(chain.p0[leg.end], dot(R0, p_s))
    rotation, z = leg.closure.rotation, R_s[:, 2]
    directions = closed_directions((0, 1, 2), rotation, R_s, z)
    J, T = _rows(chain, leg.end, p_s, directions), folding.array([other_rates(leg) for leg in group])
    idle = LegIdle.of(folding, group, J)
    apart, turning = _between(R0, (platform.V, point), (V, p_s))
    drift = minus(dot(R0.T, point_acceleration(platform.V, platform.A, point)), point_acceleration(V, c, p_s))
    turning_dot = minus(dot(R0.T, platform.A[3:]), c[3:])
    own = turns_dot(rotation, R_s, z, V[3:], V[3:], closed=True)
    k = drift_of(directions, own, drift, turning, turning_dot)
    by_platform = np.concatenate([R0, zeros(3, 3)]), np.concatenate([zeros(3, 3), R0])
    right = np.concatenate([rows_of(directions, by_platform), k[:, None]], axis=1)
    solved, doubts = solve(dot(J, T), right, pivots)
    X = dot(T, solved)
    turned = turned_apart(rotation, dot(R0, R_s), dot(platform.R, R_o))
    gaps = minus(plus(platform.p, dot(platform.R, p_o)), point), apart, k[:3]
    turns = turned, rotate(directions.turns, turning), k[3:]
    opened = _opened(platform, scale, list(zip(gaps, turns, strict=True))[: 2 if a is None else 3])
    guard = squares(doubts) + (opened if scale.compared else 0.0)
    return WrittenLeg(folding, q, chain, point, X[:, :6], X[:, 6], idle, guard)


#: Axes of frames A and B that are perpendicular while a closure holds.
PERPENDICULAR = {
    "free": (), "fixed": ((0, 1), (1, 2), (2, 0)), "parallel": ((0, 2), (1, 2)), "perpendicular": ((2, 2),),
}  # fmt: skip


def _between(
    R0: Expression, platform: tuple[Expression, Expression], leg: tuple[Expression, Expression]
) -> tuple[Expression, Expression]:
    """Return the velocity and the angular velocity of a platform's point over a leg's, in the leg's axes R0.

    Args:
        platform, leg: The twist of each, and its point.
    """
    apart = minus(dot(R0.T, point_velocity(*platform)), point_velocity(*leg))
    return apart, minus(dot(R0.T, platform[0][3:]), leg[0][3:])


def _opened(platform: PlatformMotion, scale: Scale, apart: list[tuple[Expression, Expression]]) -> Any:
    """Return the guard of positions, rates and perhaps accelerations that open a leg's closure.

    Args:
        apart: Of each, by how much it moves the ends apart, and turns them.
    """
    weights = scale.weight_of_positions, platform.rate_weight, platform.acceleration_weight
    guards = [
        weighed([(gap, scale.length), (turn, 1.0)], weight)
        for (gap, turn), weight in zip(apart, weights, strict=False)
    ]
    return reduce(add, guards)


def turned_apart(rotation: str, A: Expression, B: Expression) -> Expression:
    """Compute the rotational residuals of two frames that are nearly closed."""
    return np.array([along(A[:, i], B[:, j]) for i, j in PERPENDICULAR[rotation]], dtype=object)


def leg_pivots(group: tuple[Leg, ...], mechanism_postures: Array, scales: tuple[Array, Array]) -> Pivots:
    """Choose the pivots of a group's closures at generic postures of every leg.

    Args:
        mechanism_postures: Postures of the tree after the cuts, shape (samples, nq).
        scales: Factor of each row of the closure, and unit of each of its unknowns.
    """
    folding = Folding()
    links = fold_links(folding, [leg.links for leg in group])
    R_s, p_s, _, _ = _frames(folding, group)
    column, q = symbols("q", len(group[0].tree_q))
    chain = sweep(links, own_positions(links, q), zeros(len(group[0].tree_v)), zeros(6))
    directions = closed_directions((0, 1, 2), group[0].closure.rotation, R_s, R_s[:, 2])
    J = _rows(chain, group[0].end, p_s, directions)
    J = dot(J, folding.array([other_rates(leg) for leg in group]))
    numbers_of = zip(group, folding.table(len(group)), strict=True)
    points = [(x[leg.tree_q], own) for leg, own in numbers_of for x in mechanism_postures]
    return choose_pivots(sampled(J, [column, folding.symbol()], points), len(J), *scales)
