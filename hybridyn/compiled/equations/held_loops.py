"""A core at known accelerations and closure forces: their derivatives leave out those of the elimination.

Where K y + gamma = 0 and Psi^T b = 0, the accelerations y and what is left along the motions change by

    y_x = Psi u_x - Z (K y + gamma)_x        at held y
    (Psi^T b)_x = Psi^T (b - K^T f)_x        at held f = Z^T b

where Z solves K y = right without motions. So only the loops and the forces themselves are differentiated,
with numbers for y and f, and not the elimination that leads to Psi and Z.
"""

from __future__ import annotations

import numpy as np

from ...symbols import Expression, dot, minus, plus, times
from .core import Core, pick
from .expressions import along, eye, filled, zeros
from .factors import Handed
from .module_plan import ModulePlan

#: Arrays of `held_loops` by name.
Held = dict[str, Expression]


def along_motions(core: Core, plan: ModulePlan, a: Expression) -> tuple[Expression, Expression]:
    """Compute the core's accelerations without its spins, shape (n,), and those along its motions.

    Args:
        a: Accelerations of the spanning tree.
    """
    y = pick(a, plan.parts.v)
    for i, platform in core.platforms.items():
        y[np.array(core.chain.columns_of(i + 1)) - 6] = platform.A
    spins = [along(spin.share, y[list(spin.cols)]) for spin in plan.parts.spins]
    for spin in plan.parts.spins:
        turned = y[spin.col] / spin.axis[spin.main]  # the others have none of this freedom but by the spin
        for col, x in zip(spin.cols, spin.axis, strict=True):
            y[col] = 0.0 if col == spin.col else y[col] - times(x, turned)
    return y, np.concatenate([filled(spins, len(spins)), y[plan.motions[len(spins) :]]])


def held_loops(core: Core, plan: ModulePlan, b: Expression, a: Expression) -> Handed:
    """Return what is held of a core: Psi without spins, Z, "y" without spins and "f"; nothing without loops.

    Args:
        b: Forces over y, shape (n,).
        a: Accelerations of the spanning tree.
    """
    rows, K = len(core.rows.K), core.rows.K[:, 6:]
    solved, _ = plan.solved(K, eye(rows))
    moved = [rows + plan.free.index(col) for col in plan.motions[len(plan.parts.spins) :]]
    Z, y = solved[:, :rows], along_motions(core, plan, a)[0] if rows else zeros(len(b))
    return Handed(Psi=solved[:, moved], Z=Z, y=y, f=dot(Z.T, _unspun(plan, b)))


def left_over(core: Core, plan: ModulePlan, b: Expression, held: Held) -> tuple[Expression, Expression]:
    """Compute b - K^T f over y, without what spins take up, and b along the spins, shapes (n,), (spins,)."""
    spun = [along(spin.axis, b[list(spin.cols)]) for spin in plan.parts.spins]
    return _unspun(plan, b) - dot(core.rows.K[:, 6:].T, held["f"]), filled(spun, len(spun))


def opened_loops(core: Core, A: Expression, held: Held) -> Expression:
    """Compute K [A; y] + gamma, zero for closed loops, shape (rows,).

    Args:
        A: Acceleration of the base.
    """
    return dot(core.rows.K, np.concatenate([A, held["y"]])) + core.rows.gamma


def followed(plan: ModulePlan, u_dot: Expression, opened: Expression, held: Held) -> Expression:
    """Compute the core's accelerations at those along its motions and at rows that open, shape (n,)."""
    spins = plan.parts.spins
    change = u_dot[len(spins) :] - held["y"][plan.motions[len(spins) :]]
    y = (held["y"] + dot(held["Psi"], change) - dot(held["Z"], opened))[:, None]
    for spin, x in zip(spins, u_dot, strict=False):
        spin.taken_out(y)
        for col, share in zip(spin.cols, spin.axis, strict=True):
            y[col, 0] = plus(y[col, 0], times(share, x))
    return y[:, 0]


def _unspun(plan: ModulePlan, b: Expression) -> Expression:
    """Return the forces on motions that are made orthogonal to the spins, as `Spin.taken_out` makes them."""
    out = b.copy()
    for spin in plan.parts.spins:
        force = along(spin.axis, b[list(spin.cols)])
        for col, share in zip(spin.cols, spin.share, strict=True):
            out[col] = minus(b[col], times(share, force))
    return out
