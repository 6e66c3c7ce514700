"""Quadratic form of one module over s = [V_dot_base; y]: its motion requires the generalised forces M s + b.

It contains the core's links, the legs as they act on base and platform, and the outputs with the articulated
inertia and bias of the modules on them.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from .chains import forces, mass_matrix, motion_map
from .core import Core, Plan, own_inertia
from .expressions import Expression, congruence, dot, hat, symbols, symmetric, zeros
from .options import DirectOptions
from .rigid import classical, crf, inertia_matrix, matrix_moved, momentum, moved, resting, to_parent

#: Contributions of the legs of a platform (`legs.leg_sums`), and the size of each.
LEG_SUMS = (("S1", 10), ("B", 36), ("L", 21), ("b_base", 6), ("b_delta", 6))


def quadratic_form(
    core: Core, plan: Plan, options: DirectOptions, forced: list[int], received: dict[str, ca.SX]
) -> tuple[Expression, Expression]:
    """Compute M, shape (6 + nv, 6 + nv), and b, shape (6 + nv,).

    Args:
        options: Options of the direct model.
        forced: Freedoms of the core on which an effort acts.
        received: Filled with the columns of symbols that other kernels provide, by name.
    """
    chain, parts = core.chain, plan.parts
    tau_column, tau = symbols("tau", len(forced))
    received |= {"tau": tau_column} if forced else {}
    M, S1 = mass_matrix(chain)
    b = forces(chain) if options.velocity else zeros(6 + chain.nv)
    for k, col in enumerate(parts.tree_v):
        M[6 + k, 6 + k] = M[6 + k, 6 + k] + options.rotor[col]
    for i in sorted({group[0].platform for group in parts.groups}):
        S1 = S1 + _add_legs(core, i, M, b, received)
    M[:6, :6] = M[:6, :6] + inertia_matrix(S1)
    for o in range(len(core.outputs)):
        _add_output(core, plan, options, o, M, b, received)
    at = 6 + np.array(forced, dtype=int)
    b[at] = b[at] - tau
    return M, b


def _add_legs(core: Core, i: int, M: Expression, b: Expression, received: dict[str, ca.SX]) -> Expression:
    """Add the legs of platform i, given over [V_dot_base; delta], to M and b; return S1 as ten numbers."""
    columns = {name: symbols(f"{name} {i}", size) for name, size in LEG_SUMS}
    received |= {f"{name} {i}": column for name, (column, _) in columns.items()}
    S1, B, L, b_base, b_delta = (entries for _, entries in columns.values())
    B, L = B.reshape(6, 6), symmetric(L, 6)
    at, base = core.chain.columns_of(i + 1), range(6)
    M[:6, :6] = M[:6, :6] + (L - B - B.T)
    M[np.ix_(at, base)] = M[np.ix_(at, base)] + B.T - L
    M[np.ix_(base, at)] = M[np.ix_(base, at)] + B - L
    M[np.ix_(at, at)] = M[np.ix_(at, at)] + L
    b[:6] = b[:6] + b_base - b_delta
    b[at] = b[at] + b_delta
    return S1


def _add_output(
    core: Core, plan: Plan, options: DirectOptions, o: int, M: Expression, b: Expression,
    received: dict[str, ca.SX],
) -> None:  # fmt: skip
    """Add the inertia and bias of an output, its own or articulated, to M and b."""
    chain, body = core.chain, core.outputs[o]
    R0, p0, V = chain.R0[body], chain.p0[body], chain.V[body]
    own = own_inertia(plan, options.inertias[o], o)
    if options.carries[o]:
        received[f"I {o}"], entries = symbols(f"I {o}", 21)
        received[f"beta {o}"], beta = symbols(f"beta {o}", 6)
        inertia = matrix_moved(symmetric(entries, 6), R0, p0)
    else:
        inertia = inertia_matrix(moved(own, R0, p0))
        beta = bias_of(own, V, options.velocity)
    J, c = motion_map(chain, body), chain.c[body]
    if options.velocity:
        c = classical(V, c)
    at_zero = np.concatenate([dot(R0, c[:3]), dot(R0, c[3:])])
    at_zero[:3] = at_zero[:3] + dot(hat(p0), at_zero[3:])
    M[:] = M + congruence(J, inertia)
    b[:] = b + dot(J.T, dot(inertia, at_zero) + to_parent(R0, p0, beta))


def bias_of(own: Expression, V: Expression, velocity: bool) -> Expression:
    """Compute crf(V) (I V) of a body, where V is relative to an observer who moves with its origin."""
    return crf(resting(V), momentum(own, resting(V))) if velocity else zeros(6)
