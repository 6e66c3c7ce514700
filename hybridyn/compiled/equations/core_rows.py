"""Closures in expressions (see `linkage.closures`): rows of a module's core and their drift.

They are rows over s = [V_dot_base; y], as the models need them, and hold for closed loops.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from ...linkage.closure_rows import closed_directions, directions_of, drift_of, rows_of, slides_of, turns_dot
from ...linkage.closures import TreeClosure
from ...linkage.couplings import CouplingRows
from ...spatial import Array, cross, hat, rotate
from ...symbols import Expression, dot, minus, plus, times
from .chains import Chain, motion_map, point_acceleration, point_map, point_velocity
from .expressions import numbers, scalar, zeros
from .legs import turned_apart
from .parts import Parts
from .rods import UNFELT, Rod
from .scales import Scale, weighed


@dataclass
class CoreRows:
    """Rows of all closures of a core.

    Attributes:
        K: Shape (rows, 6 + nv): K s + gamma = 0.
        gamma: Shape (rows,).
        guard: Guard of the positions and rates of closures and couplings, and of accelerations if given.
        lines: Of each closure, the wrenches on its second body per unit multiplier of its rows, in the base,
            shape (its rows, 6); the first body has the opposite ones.
    """

    K: Expression
    gamma: Expression
    guard: ca.SX
    lines: list[Expression]


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
        plus(chain.p0[body], dot(R0, p)),
        dot(R0, point_velocity(V, p)),
        dot(R0, V[3:]),
        dot(R0, point_acceleration(V, c, p)),
        dot(R0, c[3:]),
        motion_map(chain, body),
    )


def write_rows(
    chain: Chain,
    parts: Parts,
    q: Expression,
    rates: Expression,
    accelerations: Expression | None,
    scale: Scale,
    weights: list[Any],
) -> CoreRows:
    """Write the rows of a core's closures and couplings.

    Args:
        chain: Motion of the core.
        q: Positions of its joints.
        rates: Twist of the base and rates of the joints; those of platforms are their twists, base's frame.
        accelerations: Accelerations of the joints, for the inverse model.
        scale: Scales of closure residuals.
        weights: Weights of squared residuals of rates and, if given, of accelerations (`Scale.weight`).
    """
    K, gamma = [zeros(0, 6 + chain.nv)], [zeros(0)]
    guard, lines = ca.SX(0.0), list[Expression]()
    for k, c in enumerate(parts.closures):
        a = _side(chain, c.body_a, numbers(c.R_a), numbers(c.p_a))
        b = _side(chain, c.body_b, numbers(c.R_b), numbers(c.p_b))
        turned = None
        if rod := parts.rods.get(k):
            near, far = ((c.body_a, c.p_a, -1.0), b) if rod.on_a else ((c.body_b, c.p_b, 1.0), a)
            turned = _rod_rows(chain, rod, near, far)
        rows, drift, open_by, slip, own = _closure(
            c, a, b, accelerations is not None, turned, exact=parts.mechanism.reduction.rounded
        )
        lines.append(own)
        K, gamma = [*K, rows], [*gamma, drift]
        if k >= parts.checked:
            continue
        along, units = len(c.translations), (scale.length, 1.0)
        guard = guard + weighed(list(zip(open_by, units, strict=True)), scale.weight_of_positions)
        slip = dot(rows, rates) if accelerations is None else slip  # the same, from the bodies' twists
        for weight, values in zip(weights, (slip, drift), strict=False):
            guard = guard + weighed(list(zip((values[:along], values[along:]), units, strict=True)), weight)
    if parts.couplings:
        written = CouplingRows(chain, [c._replace(offset=scalar(c.offset)) for c in parts.couplings])
        at = q[None], rates[None, 6:], None if accelerations is None else accelerations[None]
        rows, opened = numbers(written.matrix(at[0])).reshape(-1, chain.nv), written.residual(at[0])[0]
        K = [*K, np.concatenate([zeros(len(rows), 6), rows], axis=1)]
        gamma, moving = [*gamma, written.rates(*at[:2], None)[1][0]], written.rates(*at)
        for i, coupling in enumerate(parts.couplings):
            # The unit of its residual is the largest of a radian, or the length, in its terms.
            lengths = (scale.length if chain.links[j].kind.slides else 1.0 for j, _ in coupling.sizes)
            unit = max(size * length for (_, size), length in zip(coupling.sizes, lengths, strict=True))
            guard = guard + weighed([(opened[[i]], unit)], scale.weight_of_positions)
            for weight, value in zip(weights, moving, strict=False):
                guard = guard + weighed([(value[0, [i]], unit)], weight)
    return CoreRows(np.concatenate(K), np.concatenate(gamma), guard if scale.compared else ca.SX(0.0), lines)


def _rod_rows(
    chain: Chain, rod: Rod, near: tuple[int, Array, float], far: _Side
) -> tuple[Expression, Expression]:
    """Return the axes of a rod in the base, row by row, and a closure's rows along them, shape (3, 6 + nv).

    Args:
        near: Body of the rod, the closure's point on it, and the sign of its motion in the rows.
        far: The closure's other side.
    """
    body, point, sign = near
    R = dot(chain.R0[body], numbers(rod.axes))
    own = dot(numbers(rod.axes.T), point_map(chain, body, numbers(point)))
    if point.dtype != object:  # rounding of axes; where arguments move the end, they may move it off the line
        for row, col in np.ndindex(own.shape):
            if not isinstance(own[row, col], ca.SX) and abs(own[row, col]) < UNFELT * np.abs(point).max():
                own[row, col] = 0.0
        own[2, [6 + col for col in rod.turns]] = 0.0
    moved = minus(far.J[:3], dot(hat(chain.p0[body] + dot(chain.R0[body], numbers(point))), far.J[3:]))
    return R.T, times(minus(own, dot(R.T, moved)), sign)


def _closure(
    c: TreeClosure, a: _Side, b: _Side, given: bool, turned: tuple[Expression, Expression] | None,
    *, exact: bool,
) -> tuple[Expression, Expression, tuple[Expression, Expression], Expression, Expression]:  # fmt: skip
    """Compute rows and drift of one closure, residuals of translations and rotations, of rates, and `lines`.

    `given` tells that accelerations are given: the drift is then a residual, too. `turned` are other axes of
    three translations, and their rows. `exact` rows are derivatives of the residuals also where rounding of
    the file leaves the loop open; others hold for closed loops only, and take fewer operations.
    """
    form, z, whole = (c.translations, c.rotation), b.A[:, 2], len(c.translations) == 3
    directions = (directions_of if exact else closed_directions)(*form, a.A, z)
    r, apart, relative = minus(b.p, a.p), minus(b.a, a.a), minus(b.J, a.J)
    opened = r if whole else rotate(directions.axes, r)
    r = zeros(3) if whole and not exact else r
    slide, slide_dot = slides_of(r, b.v - a.v, apart, a.w, a.alpha)
    turning, w = turns_dot(c.rotation, a.A, z, a.w, b.w, closed=not exact), b.w - a.w
    slip = rows_of(directions, (slide[None], w[None]))[:, 0]
    lines = np.concatenate([directions.axes, cross(b.p[None], directions.axes)], axis=1)  # through B
    rows = rows_of(directions._replace(axes=lines), (relative.T, relative[3:].T))
    if turned and not exact:
        directions = directions if given else directions._replace(axes=turned[0])
        rows = turned[1]
    # A drift that is a residual has any axes, and the velocity apart is a residual before it, and zero.
    apart = apart if given and whole and not exact else slide_dot
    drift = drift_of(directions, turning, apart, w, b.alpha - a.alpha)
    along = turned[0] if turned and not exact else directions.axes
    forces = np.concatenate([along, cross(b.p[None], along)], axis=1)
    moments = np.concatenate([zeros(len(directions.turns), 3), numbers(directions.turns)], axis=1)
    opened_by = opened, turned_apart(c.rotation, a.A, b.A)
    return rows, drift, opened_by, slip, np.concatenate([forces, moments])
