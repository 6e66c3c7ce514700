"""Closure rows of a module's core over s = [V_dot_base; y], and their drift (see `linkage.closures`)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from ...linkage.closures import TreeClosure, TreeCoupling
from .chains import Chain, motion_map, point_acceleration, point_velocity
from .expressions import Expression, cross, dot, numbers, zeros
from .guards import Scale, loops_closed
from .links import units_of
from .residuals import coupling_row
from .rigid import to_parent


@dataclass
class Rows:
    """Rows of all closures of a core.

    Attributes:
        K: Shape (rows, 6 + nv): K s + gamma = 0.
        gamma: Shape (rows,).
        apart: Accelerations that open the loops, without units (lengths over the module's length): gamma, and
            those of couplings if accelerations are given.
        guard: Guard of the positions and rates of closures and couplings.
    """

    K: Expression
    gamma: Expression
    apart: Expression
    guard: ca.SX


@dataclass
class _Side:
    """Motion of a closure's frame on one body, in the base's axes."""

    A: Expression
    p: Expression
    v: Expression
    w: Expression
    a: Expression
    alpha: Expression
    J: Expression


def _side(chain: Chain, body: int, R: Expression, p: Expression) -> _Side:
    """Compute a frame's axes, origin, velocities, accelerations at s = 0, and its body's motion map."""
    R0, V, c = chain.R0[body], chain.V[body], chain.c[body]
    return _Side(
        dot(R0, R),
        chain.p0[body] + dot(R0, p),
        dot(R0, point_velocity(V, p)),
        dot(R0, V[3:]),
        dot(R0, point_acceleration(V, c, p)),
        dot(R0, c[3:]),
        motion_map(chain, body),
    )


def write_rows(
    chain: Chain,
    closures: tuple[TreeClosure, ...],
    couplings: tuple[TreeCoupling, ...],
    q: list[Expression],
    rates: Expression,
    accelerations: Expression | None,
    scale: Scale,
    speed: Any,
) -> Rows:
    """Write the rows of closures and couplings.

    Args:
        chain: Motion of the core.
        closures: The closures.
        couplings: The couplings.
        q: Positions of each joint.
        rates: Rates of the joints.
        accelerations: Accelerations of the joints, for the inverse model.
        scale: Scales of closure residuals.
        speed: Size of the module's rates.
    """
    K, gamma, apart = [zeros(0, 6 + chain.nv)], [zeros(0)], [zeros(0)]
    guard = ca.SX(0.0)
    for c in closures:
        a = _side(chain, c.body_a, numbers(c.R_a), numbers(c.p_a))
        b = _side(chain, c.body_b, numbers(c.R_b), numbers(c.p_b))
        rows, drift, measure = _closure(c, a, b, scale, speed)
        K, gamma = [*K, rows], [*gamma, drift]
        unit = np.array([scale.length] * len(c.translations) + [1.0] * (c.rows - len(c.translations)))
        apart = [*apart, drift / unit]
        guard = ca.fmax(guard, measure)
    for coupling in couplings:
        opened, row = coupling_row(chain, coupling, q, coupling.offset)
        size = _unit_of(chain, coupling, scale.length)
        K, gamma = [*K, np.concatenate([zeros(6), row])[None]], [*gamma, zeros(1)]
        positions = [(np.array([opened], dtype=object), size)]
        measure = loops_closed(positions, [(dot(row[None], rates), size)], speed, scale.closed)
        guard = ca.fmax(guard, measure)
        if accelerations is not None:
            apart = [*apart, dot(row[None], accelerations) / size]
    return Rows(np.concatenate(K), np.concatenate(gamma), np.concatenate(apart), guard)


def _unit_of(chain: Chain, coupling: TreeCoupling, length: float) -> float:
    """Return the unit of a coupling's residual: the largest of a radian, or the length, in its terms."""
    return max(abs(k) * float(units_of(chain.links[joint], length)[0]) for joint, k in coupling.terms)


def _closure(
    c: TreeClosure, a: _Side, b: _Side, scale: Scale, speed: Any
) -> tuple[Expression, Expression, ca.SX]:
    """Compute rows, drift and guard of one closure."""
    r, relative = b.p - a.p, b.J - a.J
    w = b.w - a.w
    axes = [a.A[:, i] for i in c.translations]
    if len(axes) == 3:
        r = zeros(3)  # the loop is closed, and all three rows together may use any axes
        axes = [numbers(np.eye(3)[i]) for i in range(3)]
    slide = b.v - a.v - cross(a.w, r)
    apart = b.a - a.a - cross(a.alpha, r) - 2 * cross(a.w, b.v - a.v) + cross(a.w, cross(a.w, r))
    normals = [to_parent(numbers(np.eye(3)), b.p, np.concatenate([n, zeros(3)])) for n in axes]
    gamma = [_along(n, apart) for n in axes]
    opened = b.p - a.p
    positions = [(np.array([_along(a.A[:, i], opened) for i in c.translations], dtype=object), scale.length)]
    rates = [(np.array([_along(n, slide) for n in axes], dtype=object), scale.length)]
    z = b.A[:, 2]
    turning: list[tuple[Expression, Expression]] = []
    if c.rotation == "fixed":
        turning = [(numbers(np.eye(3)[i]), zeros(3)) for i in range(3)]
        pairs = [(0, 1), (1, 2), (2, 0)]
    elif c.rotation == "parallel":
        turning = [(a.A[:, i], cross(a.w, a.A[:, i])) for i in (0, 1)]
        pairs = [(0, 2), (1, 2)]
    elif c.rotation == "perpendicular":
        n = cross(z, a.A[:, 2])
        turning = [(n, cross(cross(b.w, z), a.A[:, 2]) + cross(z, cross(a.w, a.A[:, 2])))]
        pairs = [(2, 2)]
    for n, n_dot in turning:
        normals.append(np.concatenate([zeros(3), n]))
        gamma.append(_along(n, b.alpha - a.alpha) + _along(n_dot, w))
    if turning:
        angles = np.array([_along(a.A[:, i], b.A[:, j]) for i, j in pairs], dtype=object)
        positions.append((angles, 1.0))
        rates.append((np.array([_along(n, w) for n, _ in turning], dtype=object), 1.0))
    rows = [dot(n[None], relative)[0] for n in normals]
    drift = np.array(gamma, dtype=object)
    return (
        np.array(rows, dtype=object).reshape(len(rows), a.J.shape[1]),
        drift,
        loops_closed(positions, rates, speed, scale.closed),
    )


def _along(n: Expression, x: Expression) -> Any:
    """Return the scalar product."""
    return dot(n, x[:, None])[0]
