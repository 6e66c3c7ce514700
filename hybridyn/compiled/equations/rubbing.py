"""Friction that grows with load in the inverse model of one module (see `dynamics.load_friction`).

Motors balance friction under a given motion, so a module's wrenches answer to its own joints alone. With the
friction n of its joints, what the law takes from their wrenches is p = p_0 + B n, and n = N(p) (`settling`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...linkage.closures import TreeClosure
from ...spatial import wrench_to_base, wrench_to_body
from ...symbols import Expression, dot, plus
from .chains import Chain, carried, carriers
from .core import Core
from .expressions import numbers, plain, zeros
from .guarded_elimination import Triangular
from .module_plan import ModulePlan
from .rubbing_joints import Rubbing, of_core, rows_of_terms, with_arguments
from .rubbing_legs import LegAnswers


def pushed_by(
    rubbing: Sequence[Rubbing], core: Core, plan: ModulePlan, v: Expression, legs: Sequence[LegAnswers]
) -> Expression:
    """Compute the forces over s that a unit of the friction of each joint needs, shape (6 + n, joints).

    Args:
        rubbing: The joints.
        v: Rates of the spanning tree.
        legs: What legs tell.
    """
    own, out = plan.parts.tree_v, zeros(6 + core.chain.nv, len(rubbing))
    place = {int(col): k for k, col in enumerate(own)}
    for j, one in enumerate(with_arguments(of_core(rubbing, plan.parts), plan.column)):
        at = [place[col] for col in one.cols]
        effort = one.effort(np.array([v[plan.parts.v[k]] for k in at], dtype=object))
        out[[6 + k for k in at], j] = -effort
    for leg in legs:
        rows = core.chain.columns_of(leg.platform + 1)
        out[:6, leg.at], out[np.ix_(rows, leg.at)] = leg.pushes, -leg.pushes
    return out


class WrenchAnswers(NamedTuple):
    """What the law takes from wrenches, for each term an array, and how it answers to friction.

    Attributes:
        alone: Without this friction, shape (k,).
        per_unit: Per unit of the friction of each joint, shape (k, joints).
    """

    alone: list[Expression]
    per_unit: list[Expression]


def answers_of_core(
    core: Core, plan: ModulePlan, rubbing: Sequence[Rubbing], moving: Chain, outputs: Sequence[Expression],
    left: Expression,
) -> Expression:  # fmt: skip
    """Compute what the law takes from the wrenches of joints of the core, shape (rows, 1 + joints).

    Args:
        rubbing: The joints of the core.
        moving: The core's motion for inertial forces.
        outputs: Wrench that each output needs, own frame.
        left: Forces along y that closures have to produce: without friction, then per unit of each joint's,
            shape (n, 1 + joints).
    """
    inertial, own = carried(moving), [zeros(0)]
    for one in rubbing:
        wrench = inertial[one.joint + 1]
        for body, W in zip(core.outputs, outputs, strict=True):
            if one.joint in carriers(core.chain, body):
                wrench = wrench + seen_from(core.chain, one.joint + 1, _in_base(core.chain, body, W))
        own += [dot(plain(term.part), wrench) for term in one.terms]
    out = dot(through_closures(core, plan, rubbing), left)
    out[:, 0] = plus(out[:, 0], np.concatenate(own))
    return out


def answers_of(rubbing: Sequence[Rubbing], rows: Expression) -> WrenchAnswers:
    """Return what the law takes from wrenches, from all rows alone and per unit of each friction."""
    each = rows_of_terms(rubbing, rows)
    return WrenchAnswers([x[:, 0] for x in each], [x[:, 1:] for x in each])


def _in_base(chain: Chain, body: int, W: Expression) -> Expression:
    """Transform a wrench on a body from its frame to the base's."""
    return wrench_to_base(chain.R0[body], chain.p0[body], W)


def seen_from(chain: Chain, body: int, W: Expression) -> Expression:
    """Transform a wrench from the base's frame to a body's."""
    return wrench_to_body(chain.R0[body], chain.p0[body], W)


def through_closures(core: Core, plan: ModulePlan, rubbing: Sequence[Rubbing]) -> Expression:
    """Return what all terms take per unit of each force along y that closures produce, shape (rows, n).

    The multipliers m of the rows with pivots have K^T m = force. Others add self-stresses, which the law does
    not feel (`dynamics.load_friction.check_determined`).
    """
    pivots, K = plan.loop_pivots, core.rows.K[:, 6:]
    per_multiplier = [
        dot(plain(term.part), wrench)
        for one in rubbing
        for wrench in [_of_multipliers(core, plan.parts.closures, one.joint)]
        for term in one.terms
    ]
    taken = np.concatenate([zeros(0, len(K)), *per_multiplier])
    out = zeros(len(taken), K.shape[1])
    if pivots.rows:
        found = Triangular.of(K, pivots).solve(taken[:, list(pivots.rows)].T)
        out[:, list(pivots.cols)] = found.T
    return out


def _of_multipliers(core: Core, closures: Sequence[TreeClosure], joint: int) -> Expression:
    """Return the wrench of a joint on its child per unit of each multiplier, child frame, shape (6, rows)."""
    out, at = zeros(6, len(core.rows.K)), 0
    for closure, lines in zip(closures, core.rows.lines, strict=True):
        first, second = (joint in carriers(core.chain, x) for x in (closure.body_a, closure.body_b))
        if first != second:
            sign = 1.0 if first else -1.0
            for r, line in enumerate(lines):
                out[:, at + r] = seen_from(core.chain, joint + 1, numbers(line)) * sign
        at += len(lines)
    return out
