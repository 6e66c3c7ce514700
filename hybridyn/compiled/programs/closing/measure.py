"""What a posture has of the numbers that are given next: where a control step in exported C starts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from ....linkage.pointing import DirectionTarget, away
from ....linkage.targets import COORDINATES, SAME_ANGLE, CoordinateTarget, PoseTarget
from ....spatial import length
from ....symbols import Expression
from ...equations.expressions import filled, pack, symbols, zeros
from .chain_targets import ChainTargets, wrapped
from .rows import coordinate_rows, quaternion_of

#: Largest deviation of quaternions and directions from a length of one: seven digits suffice.
UNIT_LENGTH = 1e-6


def measure_kernel(targets: ChainTargets) -> ca.Function:
    """Write the kernel of what is prescribed at a posture, and next.

    From placements and what is given (as prescribed, without headings) to what is prescribed there and next;
    last is a guard of the lengths of quaternions and directions. Angles are those of the triple in which
    `assemble`, with this posture as its guess, takes what is given.
    """
    given = targets.coupled.given
    column, g = symbols("given", given.size - len(given.turning))
    now, then, headings, guard = [zeros(0)], [zeros(0)], [zeros(0)], ca.SX(0.0)
    for one, at in zip(targets.coupled.relatives, given.places, strict=True):
        (R, p), target, goal, off = targets.seen(one), one.target, g[at], ca.SX(0.0)
        if isinstance(target, PoseTarget):
            unit, off = _unit(goal[-4:])
            own = np.concatenate([p[: len(goal) - 4], quaternion_of(R)])
            goal = np.concatenate([goal[:-4], unit])
        elif isinstance(target, CoordinateTarget):
            own, heading = _coordinates(R, p, target.names, goal)
            headings += [filled([heading], 1)] if target.turns else []
        elif isinstance(target, DirectionTarget):
            own, (goal, off) = R[:, target.axis], _unit(goal)
        else:
            own = np.concatenate([away(p - goal[1:])[0], goal[1:]])
        now.append(own)
        then.append(goal)
        guard = ca.fmax(guard, off)
    inputs = [*(places for places, _ in targets.places), column]
    return ca.Function("measure", inputs, [pack(*now, *headings), pack(*then, *headings), guard])


def _unit(x: Expression) -> tuple[Expression, ca.SX]:
    """Return a vector over its length, and the guard of this length."""
    size = length(x)
    return x / size, ca.fabs(size[0] - 1.0) / UNIT_LENGTH


def _coordinates(
    R: Expression, p: Expression, names: Sequence[str], wanted: Expression
) -> tuple[Expression, Any]:
    """Return some coordinates of a link in the triple of angles that is meant, and its yaw.

    It is the triple of the smaller sum, as `CoordinateTarget.headed` has it: twice how far the prescribed
    angles go, and the sizes of the others; where both cost alike, that of the smaller angles.
    """
    rows = [COORDINATES.index(name) for name in names]
    goal = dict(zip(rows, wanted, strict=True))
    sides, costs, sizes = [], [], []
    for side in (1.0, -1.0):
        values, *_ = coordinate_rows(R, p, side)
        ways = [ca.fabs(wrapped(values[i] - goal[i])) for i in (3, 4, 5) if i in goal]
        rest = [ca.fabs(values[i]) for i in (3, 4, 5) if i not in goal]
        sides.append(values)
        costs.append(sum((2.0 * x for x in ways), sum(rest, ca.SX(0.0))))
        sizes.append(sum((ca.fabs(x) for x in values[3:]), ca.SX(0.0)))
    plain = sizes[0] <= sizes[1]
    upright = ca.if_else(
        plain, ca.logic_not(costs[1] + SAME_ANGLE < costs[0]), costs[0] + SAME_ANGLE < costs[1]
    )
    chosen = [ca.if_else(upright, ca.SX(x), ca.SX(y)) for x, y in zip(*sides, strict=True)]
    return filled([chosen[i] for i in rows], len(rows)), chosen[5]
