"""The spins of a core in its models: the first of its motions, which are orthogonal to them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ....assembly.free_motions import IDLE
from ....symbols import Expression, dot, minus, plus, times
from ..expressions import along, filled
from ..module_plan import ModulePlan
from ..scales import weighed
from .inertia import decided_of, without_forces
from .motion import first_moment


def idle_guard(plan: ModulePlan, felt: Expression, moved: Expression, idle: float) -> Any:
    """Return the guard that a motion is idle where arguments change the closures or the centres of mass.

    Args:
        felt: How far the closures feel it, without units.
        moved: Its `first_moment`.
        idle: Largest part of the module's mass and length in it.
    """
    unit = plan.mechanism.length * sum(body.mass for body in plan.mechanism.spec.leg_bodies if body)
    return weighed([(felt, 1.0)], plan.scale.weight_of_positions) + weighed([(moved, unit)], idle**-2)


def hold_idle(plan: ModulePlan, K: Expression, guard: Any) -> Any:
    """Make the rows of a core not feel the freedoms that stand for spins, in place, and return their guard.

    Args:
        K: The rows over the core's freedoms, shape (rows, n).
        guard: That of the rows so far; with arguments, spins must be idle, too.
    """
    for spin in plan.parts.idle:
        if plan.column is not None:
            felt = dot(K[:, list(spin.cols)], spin.axis)
            felt = felt * plan.mechanism.reduction.row_scale[list(plan.parts.closure_rows)]
            guard = guard + idle_guard(plan, felt, first_moment(spin, plan.parts.links), IDLE)
        K[:, spin.col] = 0.0
    return guard


def part_idle(plan: ModulePlan, X: Expression, first: int) -> None:
    """Put the spins into the columns of X that begin with `first`, and make all others orthogonal to them."""
    for i, spin in enumerate(plan.parts.idle):
        spin.taken_out(X)
        X[:, first + i] = 0.0
        X[list(spin.cols), first + i] = spin.axis


def set_idle(plan: ModulePlan, y: Expression, u_dot: Expression) -> None:
    """Give accelerations y of a core, shape (n, 1), those of its spins, the first of u_dot, in place."""
    for spin, x in zip(plan.parts.idle, u_dot, strict=False):
        spin.taken_out(y)
        for col, share in zip(spin.cols, spin.axis, strict=True):
            y[col, 0] = y[col, 0] + times(share, x)


def idle_apart(plan: ModulePlan, y: Expression) -> tuple[Expression, Expression]:
    """Return accelerations of a core's freedoms without those of its spins, and those along its motions."""
    out = y.copy()
    turned = [along(spin.share, y[list(spin.cols)]) for spin in plan.parts.idle]
    for spin in plan.parts.idle:
        own = y[spin.col] / spin.axis[spin.main]  # the others have none of this freedom but by the spin
        for col, x in zip(spin.cols, spin.axis, strict=True):
            out[col] = 0.0 if col == spin.col else y[col] - times(x, own)
    return out, np.concatenate([filled(turned, len(turned)), out[plan.motions[len(turned) :]]])


def forces_apart(plan: ModulePlan, b: Expression) -> tuple[Expression, Expression]:
    """Return forces on motions of a core that are made orthogonal to its spins, and those along the spins."""
    out = b.copy()
    spun = [along(spin.axis, b[list(spin.cols)]) for spin in plan.parts.idle]
    for spin, force in zip(plan.parts.idle, spun, strict=True):
        for col, share in zip(spin.cols, spin.share, strict=True):
            out[col] = minus(b[col], times(share, force))
    return out, filled(spun, len(spun))


def left_on_idle(plan: ModulePlan, rotor: Sequence[float], left: Expression, u_dot: Expression) -> None:
    """Put the acceleration of spins without inertia in the place of the force left on them, in place.

    Args:
        rotor: Rotor inertias over the freedoms of the tree after the cuts.
        left: Forces left along the core's motions.
        u_dot: Accelerations along them.
    """
    for i, spin in enumerate(decided_of(plan, rotor)):
        left[i] = plus(times(spin.has, left[i]), times(1.0 - spin.has, u_dot[i]))


def rest_idle(
    plan: ModulePlan,
    rotor: Sequence[float],
    equation: tuple[Expression, ...],
    f: Expression,
) -> Any:
    """Give spins without inertia no acceleration, the least; return the guard that they have and feel none.

    Args:
        rotor: Rotor inertias over the freedoms of the tree after the cuts.
        equation: A_t, E, Q_0 and columns of further forces Q_n of the module, changed in place.
        f: The forces along y, of whose terms those on the spins may be rounding.
    """
    A_t, E, Q_0, Q_n = equation
    guard: Any = 0.0
    for i, spin in enumerate(decided_of(plan, rotor)):
        left = np.array([times(1.0 - spin.has, Q_0[i])], dtype=object)
        guard = guard + spin.guard + without_forces(plan, left, f, plan.parts.tree_v)
        own = plus(times(spin.has, A_t[i, i]), 1.0 - spin.has)
        for row in (E[i], Q_0[i : i + 1], Q_n[i], A_t[i], A_t[:, i]):
            row[:] = [times(spin.has, x) for x in row]
        A_t[i, i] = own
    return guard
