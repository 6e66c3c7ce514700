"""Closures in expressions (see `linkage.closures`): rows of a module's core, and residuals of a tree.

Rows over s = [V_dot_base; y] and their drift are those of the models. Residuals and their Jacobian on a
spanning tree are for Newton's method: unlike the rows, they also hold for open loops.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from ...joints.kinds import RotationKind
from ...linkage.closures import TURNING, TreeClosure, normals
from ...linkage.couplings import TreeCoupling
from ...linkage.joints import TreeJoint
from ...spatial import Array
from ...structure.mechanism import Mechanism
from ...structure.module import Module
from ...structure.module_spec import ModuleSpec
from .chains import Chain, motion_map, own_columns, point_acceleration, point_map, point_velocity, sweep
from .expressions import (
    Expression,
    Folding,
    along,
    cross,
    dot,
    hat,
    minus,
    numbers,
    plus,
    sampled,
    scalar,
    symbols,
    zeros,
)
from .guarded_elimination import Pivots, Scale, choose_pivots, weighed
from .legs import fold_links, turned_apart
from .parts import Parts, Rod, is_ball, rods_of
from .rigid import links_of, motion_to_parent, to_parent
from .spins import UNFELT, spins_of
from .states import generic_positions

#: Frames of a closure on its bodies: axes and origin of A, axes and origin of B.
Frames = tuple[Expression, Expression, Expression, Expression]


class SpanningRows:
    """Residuals and Jacobian rows over the rates of a spanning tree at one posture."""

    def __init__(self, chain: Chain) -> None:
        self._chain = chain
        self._columns = [
            [motion_to_parent(chain.R0[i + 1], chain.p0[i + 1], column) for column in S.T]
            for i, S in enumerate(chain.S)
        ]

    def closure(self, c: TreeClosure, frames: Frames) -> tuple[Expression, Expression]:
        """Compute a closure's residual, shape (rows,), and Jacobian, shape (rows, nv)."""
        R_a, p_a, R_b, p_b = frames
        A, pa = self._frame(c.body_a, R_a, p_a)
        B, pb = self._frame(c.body_b, R_b, p_b)
        axes = [A[:, i] for i in c.translations]
        residual = [along(n, pb - pa) for n in axes]
        normals = [np.concatenate([n, cross(pb, n)]) for n in axes]
        for angle, n in _turning(c.rotation, A, B):
            residual.append(angle)
            normals.append(np.concatenate([zeros(3), n]))
        rows = zeros(len(normals), self._chain.nv)
        for sign, body in ((1.0, c.body_b), (-1.0, c.body_a)):
            for joint in self._path(body) - self._path(c.body_a if sign > 0 else c.body_b):
                for k, column in enumerate(self._columns[joint], self._chain.v_slices[joint].start):
                    rows[:, k] = [sign * along(n, column) for n in normals]
        return np.array(residual, dtype=object), rows

    def rates(self, c: TreeClosure, frames: Frames, v: Expression) -> Expression:
        """Compute the rates of a closure's residual, its Jacobian times v, from the twists of its bodies.

        The product with the matrix has more operations, and so has its derivative.
        """
        A, _ = self._frame(c.body_a, frames[0], frames[1])
        B, pb = self._frame(c.body_b, frames[2], frames[3])
        twist = self._twist(c.body_b, c.body_a, v) - self._twist(c.body_a, c.body_b, v)
        at = twist[:3] + cross(twist[3:], pb)
        rates = [along(A[:, i], at) for i in c.translations]
        rates += [along(n, twist[3:]) for _, n in _turning(c.rotation, A, B)]
        return np.array(rates, dtype=object)

    def on_rod(
        self, c: TreeClosure, frames: Frames, turns: Sequence[int], on_line: bool, *, exact: bool = False
    ) -> tuple[Expression, Expression]:
        """Compute `closure` for a rod's end, A, in the rod's axes, with few operations.

        How the rod moves its own end does not depend on where the rod is. The end is taken at A, where the
        closure is once it is closed.

        Args:
            turns: Freedoms that turn the rod about a point of its line.
            on_line: Whether A is on this line; arguments may move it off.
            exact: Whether the rows are derivatives of the residual also where the closure is open, but for
                turns about the line.
        """
        residual, rows = self.closure(c, frames)
        own, slices = own_columns(self._chain, c.body_a), self._chain.v_slices
        beyond = [
            k
            for joint in self._path(c.body_a) - self._path(c.body_b)
            if slices[joint].stop > min(turns, default=self._chain.nv)
            for k in range(slices[joint].start, slices[joint].stop)
        ]
        for k in beyond:
            rows[:, k] = -dot(frames[0].T, point_velocity(own[k], frames[1]))
        if on_line:
            rows[2, list(turns)] = 0.0  # rounding
        for k in beyond if exact else ():
            x, y, _ = dot(frames[0].T, own[k][3:])
            off = cross(np.array([x, y, 0.0], dtype=object), residual)
            rows[:, k] = minus(rows[:, k], off)
        return residual, rows

    def drift(self, c: TreeClosure, frames: Frames) -> Expression:
        """Compute the derivative of a closure's three rows times the chain's rates, which close it."""
        a, b = (
            point_acceleration(self._chain.V[body], self._chain.c[body], p)
            for body, p in ((c.body_a, frames[1]), (c.body_b, frames[3]))
        )
        A = dot(self._chain.R0[c.body_a], frames[0])
        out: Expression = minus(dot(A.T, dot(self._chain.R0[c.body_b], b)), dot(frames[0].T, a))
        return out

    def _twist(self, body: int, other: int, v: Expression) -> Expression:
        """Compute the twist of a body in the base frame, without joints that carry the other body, too."""
        out = zeros(6)
        for joint in sorted(self._path(body) - self._path(other)):
            columns = np.stack(self._columns[joint], axis=1)
            out = plus(out, dot(columns, v[self._chain.v_slices[joint]]))
        return out

    def _frame(self, body: int, R: Expression, p: Expression) -> tuple[Expression, Expression]:
        """Compute axes and origin of a frame on a body, in the base frame."""
        R0 = self._chain.R0[body]
        return dot(R0, R), self._chain.p0[body] + dot(R0, p)

    def _path(self, body: int) -> set[int]:
        """Return the joints that carry a body."""
        return {body - 1} | self._path(self._chain.links[body - 1].parent) if body else set()


def _turning(rotation: RotationKind, A: Expression, B: Expression) -> list[tuple[Any, Expression]]:
    """Return the rotational residuals, each with the axis of its rate."""
    z = B[:, 2]
    if rotation == "fixed":
        pairs = [(1, 2), (2, 0), (0, 1)]
        angles = [0.5 * (along(A[:, j], B[:, i]) - along(A[:, i], B[:, j])) for i, j in pairs]
    else:
        angles = [along(n, z) for n in A.T[TURNING[rotation]]]
    return list(zip(angles, normals(rotation, A, z), strict=True))


def coupling_row(
    chain: Chain, coupling: TreeCoupling, positions: list[Expression], offset: Any
) -> tuple[Any, Expression]:
    """Compute a coupling's residual, and its Jacobian row of shape (nv,)."""
    row, total = zeros(chain.nv), -offset
    for joint, coefficient in coupling.terms:
        at = chain.v_slices[joint].start
        row[at] = row[at] + coefficient
        total = total + coefficient * positions[joint][0]
    if curve := coupling.curve:
        value, slope, _ = curve.at(curve.argument({joint: positions[joint][0] for joint, _ in curve.terms}))
        total = total + value
        for joint, factor in curve.terms:
            at = chain.v_slices[joint].start
            row[at] = row[at] + factor * slope
    return total, row


def coupling_drift(
    chain: Chain, coupling: TreeCoupling, positions: list[Expression], rates: Expression
) -> Any:
    """Compute the derivative of a coupling's row times the chain's rates: that of its curve."""
    if not (curve := coupling.curve):
        return 0.0
    bend = curve.at(curve.argument({joint: positions[joint][0] for joint, _ in curve.terms}))[2]
    rate = sum(factor * rates[chain.v_slices[joint].start] for joint, factor in curve.terms)
    return bend * rate * rate


@dataclass
class CoreRows:
    """Rows of all closures of a core.

    Attributes:
        K: Shape (rows, 6 + nv): K s + gamma = 0.
        gamma: Shape (rows,).
        guard: Guard of the positions and rates of closures and couplings, and of accelerations if given.
    """

    K: Expression
    gamma: Expression
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
    parts: Parts,
    q: list[Expression],
    rates: Expression,
    accelerations: Expression | None,
    scale: Scale,
    weights: list[Any],
) -> CoreRows:
    """Write the rows of a core's closures and couplings.

    Args:
        chain: Motion of the core.
        q: Positions of each joint.
        rates: Twist of the base and rates of the joints; those of platforms are their twists, base's frame.
        accelerations: Accelerations of the joints, for the inverse model.
        scale: Scales of closure residuals.
        weights: Weights of squared residuals of rates and, if given, of accelerations (`Scale.weight`).
    """
    K, gamma = [zeros(0, 6 + chain.nv)], [zeros(0)]
    guard = ca.SX(0.0)
    for k, c in enumerate(parts.closures):
        a = _side(chain, c.body_a, numbers(c.R_a), numbers(c.p_a))
        b = _side(chain, c.body_b, numbers(c.R_b), numbers(c.p_b))
        turned = None
        if rod := parts.rods.get(k):
            near, far = ((c.body_a, c.p_a, -1.0), b) if rod.on_a else ((c.body_b, c.p_b, 1.0), a)
            turned = _rod_rows(chain, rod, near, far)
        rows, drift, open_by, slip = _closure(
            c, a, b, accelerations is not None, turned, exact=parts.mechanism.reduction.rounded
        )
        K, gamma = [*K, rows], [*gamma, drift]
        if k >= parts.checked:
            continue
        along, units = len(c.translations), (scale.length, 1.0)
        guard = guard + weighed(list(zip(open_by, units, strict=True)), scale.weight_of_positions)
        slip = dot(rows, rates) if accelerations is None else slip  # the same, from the bodies' twists
        for weight, values in zip(weights, (slip, drift), strict=False):
            guard = guard + weighed(list(zip((values[:along], values[along:]), units, strict=True)), weight)
    for coupling in parts.couplings:
        opened, row = coupling_row(chain, coupling, q, coupling.offset)
        # The unit of its residual is the largest of a radian, or the length, in its terms.
        lengths = (scale.length if chain.links[j].kind.slides else 1.0 for j, _ in coupling.sizes)
        unit = max(size * length for (_, size), length in zip(coupling.sizes, lengths, strict=True))
        drift = np.array([coupling_drift(chain, coupling, q, rates[6:])], dtype=object)
        K, gamma = [*K, np.concatenate([zeros(6), row])[None]], [*gamma, drift]
        guard = guard + weighed([(np.array([opened], dtype=object), unit)], scale.weight_of_positions)
        moving = [dot(row[None], rates[6:])]
        if accelerations is not None:
            moving.append(plus(dot(row[None], accelerations), drift))
        for weight, value in zip(weights, moving, strict=True):
            guard = guard + weighed([(value, unit)], weight)
    return CoreRows(np.concatenate(K), np.concatenate(gamma), guard if scale.compared else ca.SX(0.0))


def _rod_rows(
    chain: Chain, rod: Rod, near: tuple[int, Array, float], far: _Side
) -> tuple[list[Expression], Expression]:
    """Return the directions of a closure's rows along the axes of a rod, and the rows, shape (3, 6 + nv).

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
    return [R[:, i] for i in range(3)], minus(own, dot(R.T, moved)) * sign


def _closure(
    c: TreeClosure, a: _Side, b: _Side, given: bool, turned: tuple[list[Expression], Expression] | None,
    *, exact: bool,
) -> tuple[Expression, Expression, tuple[Expression, Expression], Expression]:  # fmt: skip
    """Compute rows and drift of one closure, the residuals of its translations and rotations, and of rates.

    `given` tells that accelerations are given: the drift is then a residual, too. `turned` are other axes of
    three translations, and their rows. `exact` rows are derivatives of the residuals also where rounding of
    the file leaves the loop open; others hold for closed loops only, and take fewer operations.
    """
    r, relative = b.p - a.p, b.J - a.J
    w = b.w - a.w
    axes = [a.A[:, i] for i in c.translations]
    if len(axes) == 3:  # all three rows together may use any axes, and the loop is closed
        still = [numbers(np.eye(3)[i]) for i in range(3)]  # a drift that is a residual has any axes, too
        axes, opened = turned[0] if turned and not given else still, r
        r = r if exact else zeros(3)
    else:
        opened = np.array([along(n, r) for n in axes], dtype=object)
    apart = b.a - a.a
    if exact or not given or len(axes) < 3:  # else `b.v - a.v` is a residual, and zero
        apart = apart - cross(a.alpha, r) - 2 * cross(a.w, b.v - a.v) + cross(a.w, cross(a.w, r))
    normals = [to_parent(numbers(np.eye(3)), b.p, np.concatenate([n, zeros(3)])) for n in axes]
    gamma = [along(n, apart) for n in axes]
    z = b.A[:, 2]
    turning: list[tuple[Expression, Expression]] = []
    if c.rotation == "fixed":
        still = [numbers(np.eye(3)[i]) for i in range(3)]
        turning = [(n, cross(a.w, n) if exact else zeros(3)) for n in still]
    elif c.rotation == "parallel" and exact:
        across = [(a.A[:, i], cross(a.w, a.A[:, i])) for i in (0, 1)]
        turning = [(cross(z, n), cross(cross(b.w, z), n) + cross(z, n_dot)) for n, n_dot in across]
    elif c.rotation == "parallel":
        turning = [(a.A[:, i], cross(a.w, a.A[:, i])) for i in (0, 1)]
    elif c.rotation == "perpendicular":
        n = cross(z, a.A[:, 2])
        turning = [(n, cross(cross(b.w, z), a.A[:, 2]) + cross(z, cross(a.w, a.A[:, 2])))]
    slip = [along(n, b.v - a.v - cross(a.w, r)) for n in axes] + [along(n, w) for n, _ in turning]
    for n, n_dot in turning:
        normals.append(np.concatenate([zeros(3), n]))
        gamma.append(along(n, b.alpha - a.alpha) + along(n_dot, w))
    every = [dot(n[None], relative)[0] for n in normals]
    rows = every if turned is None or exact else list(turned[1])
    return (
        np.array(rows, dtype=object).reshape(len(rows), a.J.shape[1]),
        np.array(gamma, dtype=object),
        (opened, turned_apart(c.rotation, a.A, b.A)),
        np.array(slip, dtype=object),
    )


#: Pivots smaller than the best by this factor may be chosen to keep the rows sparse. Smaller factors keep
#: them sparser, but time steps are less exact than with charts of the tangent space: by 50 times at 0.1, by 3
#: here.
SPARSE_SPANNING = 0.5
#: Factor on pivots of freedoms that should stay independent: they are chosen only if all others are this
#: small.
LAST = 1e-4


def shape_of(module: Module, *more: Any) -> Any:
    """Return a key that is equal for modules that share one kernel."""
    spec = module.mechanism.spec
    if not module.mechanism.spanning_closures.rows:
        return tuple(joint.kind for joint in spec.spanning), *more
    joints = tuple((j.kind, j.parent, tuple(j.axis.tolist())) for j in spec.spanning)
    closures = tuple((c.body_a, c.body_b, c.translations, c.rotation) for c in spec.closures)
    couplings = tuple(c.form for c in spec.couplings)
    return joints, closures, couplings, module.mobility, module.mechanism.length, *more


def along_rods(closures: Sequence[TreeClosure], rods: Mapping[int, Rod]) -> tuple[TreeClosure, ...]:
    """Return closures of which those on rods begin at the rod, in its axes."""
    out = list(closures)
    for k, rod in rods.items():
        c = out[k]
        if not rod.on_a:
            c = replace(c, body_a=c.body_b, p_a=c.p_b, body_b=c.body_a, R_b=c.R_a, p_b=c.p_a)
        out[k] = replace(c, R_a=rod.axes)
    return tuple(out)


class LoopRows:
    """Rows of closures and couplings of a spanning tree at one posture.

    Attributes:
        K: Shape (rows, nv).
        residual: Shape (rows,).
        rates: K times given rates, shape (rows,), from the twists of the bodies; empty if none were given.
            Those of balls are left out.
        drift: K_dot times these rates for the rows of balls, else 0, shape (rows,).
        exact: Whether rows on rods hold for open loops, too.
    """

    def __init__(self, chain: Chain, v: Expression | None) -> None:
        """Begin without rows; `v` are the given rates, those of the chain."""
        self.K, self.residual = zeros(0, chain.nv), zeros(0)
        self.rates, self.drift = zeros(0), zeros(0)
        self.chain, self.writer, self._v = chain, SpanningRows(chain), v
        self.exact = False

    def add(
        self,
        K: Expression,
        residual: Expression,
        rates: Expression | None = None,
        drift: Expression | None = None,
    ) -> None:
        """Add rows, by default with the rates K v."""
        if self._v is not None:
            own = dot(K, self._v) if rates is None else rates
            self.rates = np.concatenate([self.rates, own])
            self.drift = np.concatenate([self.drift, zeros(len(K)) if drift is None else drift])
        self.K, self.residual = np.concatenate([self.K, K]), np.concatenate([self.residual, residual])

    def close(self, closure: TreeClosure, frames: Frames) -> None:
        """Add the rows of a closure."""
        self._add(closure, frames, *self.writer.closure(closure, frames))

    def _add(self, closure: TreeClosure, frames: Frames, residual: Expression, K: Expression) -> None:
        """Add rows; the change of a ball's is that of its points, once their velocities are one."""
        if self._v is None:
            self.add(K, residual)
        elif is_ball(closure):
            self.add(K, residual, zeros(3), self.writer.drift(closure, frames))
        else:
            self.add(K, residual, self.writer.rates(closure, frames, self._v))

    def close_all(
        self,
        closures: Sequence[Sequence[TreeClosure]],
        couplings: Sequence[Sequence[TreeCoupling]],
        rods: Mapping[int, Rod],
        folding: Folding,
        positions: list[Expression],
    ) -> None:
        """Add the rows of all closures and couplings of several modules; `positions` of each joint."""
        for k, same in enumerate(zip(*closures, strict=True)):
            own, rod = folded(folding, same), rods.get(k)
            if rod is None:
                self.close(same[0], own)
            else:
                on_line = not any(c.p_a.dtype == object for c in same)
                rows = self.writer.on_rod(same[0], own, rod.turns, on_line, exact=self.exact)
                self._add(same[0], own, *rows)
        for coupled in zip(*couplings, strict=True):
            offset = folding.array([scalar(c.offset) for c in coupled])[0]
            miss, row = coupling_row(self.chain, coupled[0], positions, offset)
            self.add(row[None], np.array([miss], dtype=object))


def folded(folding: Folding, same: Sequence[TreeClosure]) -> Frames:
    """Return the frames of equal closures of several modules."""
    R_a, p_a, R_b, p_b = (
        folding.array([getattr(c, name) for c in same]) for name in ("R_a", "p_a", "R_b", "p_b")
    )
    return R_a, p_a, R_b, p_b


def spinning_rods(
    m: Mechanism, joints: tuple[TreeJoint, ...], closures: Sequence[TreeClosure]
) -> dict[int, Rod]:
    """Return the rods of closures of a module's tree if some of its rods spin, by the closure's number."""
    bare = links_of(joints, [np.zeros(10)] * len(joints))
    return rods_of(bare, closures) if spins_of(m, ()) else {}


def spanning_closures(
    modules: list[Module],
    folding: Folding,
    q: Expression,
    specs: Sequence[ModuleSpec] = (),
    v: Expression | None = None,
) -> LoopRows:
    """Compute the rows of all closures and couplings.

    Args:
        modules: Modules of one shape.
        folding: Collects the numbers in which they differ.
        q: Positions of the spanning tree.
        specs: The modules' numbers where some are arguments.
        v: Rates of the spanning tree, or None.
    """
    m = modules[0].mechanism
    specs = specs or [module.mechanism.spec for module in modules]
    links = fold_links(folding, [links_of(s.spanning, [np.zeros(10)] * len(s.spanning)) for s in specs])
    rods = spinning_rods(m, m.spec.spanning, m.spec.closures)
    out = LoopRows(sweep(links, q, zeros(m.spanning.nv) if v is None else v, zeros(6)), v)
    closures, couplings = [along_rods(s.closures, rods) for s in specs], [s.couplings for s in specs]
    out.close_all(closures, couplings, rods, folding, [q[at] for at in m.spanning.q_slices])
    return out


def generic_rows(modules: list[Module]) -> Array:
    """Compute the rows of all closures at generic postures, module by module, shape (samples, rows, nv)."""
    m, folding = modules[0].mechanism, Folding()
    q_col, q = symbols("q", m.spanning.nq)
    K = spanning_closures(modules, folding, q).K
    numbers_of = zip(modules, folding.table(len(modules)), strict=True)
    points = [(x, own) for module, own in numbers_of for x in generic_positions(module)]
    return sampled(K, [q_col, folding.symbol()], points)


def dependent_pivots(modules: list[Module], K: Array, last: Sequence[int] = ()) -> Pivots:
    """Choose dependent coordinates with large pivots at generic postures of all modules of a shape.

    Args:
        K: Their `generic_rows`.
        last: Freedoms that should stay independent if possible.
    """
    m = modules[0].mechanism
    rank, unit = m.spanning.nv - m.mobility, m.spanning_col_scale.copy()
    unit[list(last)] *= LAST
    return choose_pivots(K, rank, m.spanning_row_scale, unit, SPARSE_SPANNING)
