"""A core at known accelerations and closure forces: their derivatives leave out those of the elimination.

Where K y + gamma = 0 and Psi^T b = 0, the accelerations y and what is left along the motions change by

    y_x = Psi u_x - Z (K y + gamma)_x        at held y
    (Psi^T b)_x = Psi^T (b - K^T f)_x        at held f = Z^T b

where Z solves K y = right without motions. So only the loops and the forces themselves are differentiated,
with numbers for y and f, and not the elimination that leads to Psi and Z.
"""

from __future__ import annotations

import numpy as np

from ...symbols import Expression, dot
from .core import Core
from .expressions import eye, pick, zeros
from .factors import Handed
from .idle.cores import forces_apart, idle_apart, left_on_idle, set_idle
from .module_plan import ModulePlan
from .options import Options
from .own_axes import own_rates

#: Arrays of `held_loops` by name.
Held = dict[str, Expression]


def along_motions(core: Core, plan: ModulePlan, a: Expression) -> tuple[Expression, Expression]:
    """Compute the core's accelerations without its idle motions, shape (n,), and those along its motions.

    Args:
        a: Accelerations of the spanning tree.
    """
    y = own_rates(plan.parts.links, pick(a, plan.parts.v))
    for i, platform in core.platforms.items():
        y[np.array(core.chain.columns_of(i + 1)) - 6] = platform.A
    return idle_apart(plan, y)


def held_loops(core: Core, plan: ModulePlan, b: Expression, a: Expression) -> Handed:
    """Return what is held of a core: Psi, Z and "y" without idle motions, and "f"; nothing without loops.

    Args:
        b: Forces over y, shape (n,).
        a: Accelerations of the spanning tree.
    """
    rows, K = len(core.rows.K), core.rows.K[:, 6:]
    solved, _ = plan.solved(K, eye(rows))
    moved = [rows + plan.free.index(col) for col in plan.motions[plan.idle :]]
    Z, y = solved[:, :rows], along_motions(core, plan, a)[0] if rows else zeros(len(b))
    return Handed(Psi=solved[:, moved], Z=Z, y=y, f=dot(Z.T, forces_apart(plan, b)[0]))


def left_over(core: Core, plan: ModulePlan, b: Expression, held: Held) -> tuple[Expression, Expression]:
    """Compute b - K^T f over y, and b along the idle motions, which it is without, shapes (n,), (idle,)."""
    rest, along_idle = forces_apart(plan, b)
    return rest - dot(core.rows.K[:, 6:].T, held["f"]), along_idle


def left_along(core: Core, plan: ModulePlan, options: Options, left: Expression, a: Expression) -> Expression:
    """Put accelerations of idle motions in the place of forces left on them (`left_on_idle`).

    Args:
        left: Forces along the motions, idle ones first.
        a: Accelerations of the spanning tree.
    """
    left_on_idle(plan, options.rotor, left, along_motions(core, plan, a)[1])
    return left


def opened_loops(core: Core, A: Expression, held: Held) -> Expression:
    """Compute K [A; y] + gamma, zero for closed loops, shape (rows,).

    Args:
        A: Acceleration of the base.
    """
    return dot(core.rows.K, np.concatenate([A, held["y"]])) + core.rows.gamma


def followed(plan: ModulePlan, u_dot: Expression, opened: Expression, held: Held) -> Expression:
    """Compute the core's accelerations at those along its motions and at rows that open, shape (n,)."""
    change = u_dot[plan.idle :] - held["y"][plan.motions[plan.idle :]]
    y = (held["y"] + dot(held["Psi"], change) - dot(held["Z"], opened))[:, None]
    set_idle(plan, y, u_dot)
    return y[:, 0]
