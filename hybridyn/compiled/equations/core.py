"""Write one module's core: its motion, its loops, platforms and wrists. Choose the module's pivots."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from ...linkage.reduction import RANK_TOLERANCE
from ...spatial import motion_to_base, motion_to_body
from ...symbols import Expression, dot, is_zero, plus
from .chains import Chain, Placed, sweep
from .core_rows import CoreRows, write_rows
from .expressions import plain, symbols, zeros
from .idle.cores import hold_idle, part_idle
from .legs import PlatformMotion
from .module_plan import ModulePlan
from .own_axes import own_motion
from .scales import Scale, largest, size_of


@dataclass(eq=False)
class Core:
    """A module's core in expressions.

    Attributes:
        chain: Its motion, including base and platforms.
        platforms: Motion of each platform for its legs, by the platform's link.
        rows: Rows of its closures.
        outputs: Body of each output.
    """

    chain: Chain
    platforms: dict[int, PlatformMotion]
    rows: CoreRows
    outputs: list[int]

    def platform_columns(self) -> dict[str, ca.SX]:
        """Return the platforms' motion for the legs, by name."""
        return {f"platform {i}": motion.column() for i, motion in sorted(self.platforms.items())}


def write_core(
    plan: ModulePlan,
    q: Expression,
    v: Expression,
    V_base: Expression,
    a: Expression | None = None,
    A_base: Expression | None = None,
) -> Core:
    """Write the motion of a module's core and of its platforms.

    Args:
        q: Positions of its spanning tree.
        V_base: Twist of its base, own frame.
        a: Accelerations of its spanning tree, for the inverse model.
        A_base: Acceleration of its base less gravity, for the inverse model.
    """
    parts = plan.parts
    placed, platforms = _platforms(plan, (q, v, a), (V_base, A_base))
    tree_q, tree_v, tree_a = own_motion(parts, q, v, a)
    chain = sweep(parts.links, tree_q, tree_v, V_base, tree_a, A_base, placed)
    twists = tree_v.copy()
    for i, motion in platforms.items():
        twists[chain.v_slices[i]] = motion.V
    rates = np.concatenate([V_base, twists])
    weights = _weights(plan, (tree_v, tree_a), (V_base, A_base), list(platforms.values()))
    rows = write_rows(chain, parts, tree_q, rates, tree_a, plan.scale, weights)
    rows.guard = hold_idle(plan, rows.K[:, 6:], rows.guard)
    return Core(chain, platforms, rows, list(plan.mechanism.spec.outputs))


@dataclass(eq=False)
class PosedCore:
    """A module's core at rest in any posture, at which pivots are chosen; it is written when it is asked for.

    Attributes:
        plan: What is chosen about the module: all but the pivots of its core.
    """

    plan: ModulePlan

    @cached_property
    def written(self) -> tuple[ca.SX, Expression, Core]:
        """The column of the positions of the spanning tree, the positions, and the core."""
        tree = self.plan.mechanism.spanning
        column, q = symbols("q", tree.nq)
        return column, q, write_core(self.plan, q, zeros(tree.nv), zeros(6))


def _platforms(
    plan: ModulePlan,
    own: tuple[Expression, Expression, Expression | None],
    base: tuple[Expression, Expression | None],
) -> tuple[dict[int, Placed], dict[int, PlatformMotion]]:
    """Return the motion of each platform, by its link, from the joints of the wrist that carries it.

    Args:
        own: q, v and a of the spanning tree.
        base: Twist and acceleration of the base.
    """
    q, v, a = own
    placed, platforms = dict[int, Placed](), dict[int, PlatformMotion]()
    for path in plan.parts.paths:
        if path.wrist.carries:
            path_q, path_v, path_a = own_motion(path, q, v, a)
            chain = sweep(path.links, path_q, path_v, base[0], path_a, base[1], placed)
            i, end = path.target - 1, path.end
            R, p, V, c = chain.R0[end], chain.p0[end], chain.V[end], chain.c[end]
            placed[i] = Placed(R, p, V, zeros(6) if a is None else c)
            platforms[i] = _platform(Placed(R, p, V, c), base, plan.scale)
    return placed, platforms


def _weights(
    plan: ModulePlan,
    own: tuple[Expression, Expression | None],
    base: tuple[Expression, Expression | None],
    platforms: Sequence[PlatformMotion],
) -> list[Any]:
    """Return the weights of what opens the loops: of rates, and of accelerations where they are given.

    Args:
        own: Rates and accelerations of the core's freedoms.
        base: Twist and acceleration of the base.
        platforms: Motion of the platforms.
    """
    (v, a), (V_base, A_base), length = own, base, plan.mechanism.length
    units = plan.mechanism.reduction.col_scale[plan.parts.tree_v]
    sizes = [size_of(v, units, [V_base, *(p.V for p in platforms)], length)]
    if a is not None and A_base is not None:
        haste = size_of(a, units, [A_base, *(p.A for p in platforms)], length)
        sizes.append(haste + sizes[0] * sizes[0])
    return [plan.scale.weight(size) for size in sizes]


def _platform(at: Placed, base: tuple[Expression, Expression | None], scale: Scale) -> PlatformMotion:
    """Return a platform's motion for its legs; the base's acceleration is None without accelerations."""
    V_base, A_base = base
    V = motion_to_base(at.R, at.p, at.V)
    speed = size_of(zeros(0), [], [V_base, V], scale.length)
    if A_base is None:
        return PlatformMotion(at.R, at.p, V, scale.weight(speed))
    A = motion_to_base(at.R, at.p, at.c)
    haste = size_of(zeros(0), [], [A_base, A], scale.length) + speed * speed
    return PlatformMotion(at.R, at.p, V, scale.weight(speed), A, scale.weight(haste))


def motions_of(plan: ModulePlan, K: Expression, right: Expression) -> tuple[Expression, Expression]:
    """Solve a core's closures K y = right by the chosen pivots.

    Returns:
        X: y over [right-hand sides, motions], shape (n, k + motions); idle motions come first, and all
            else is orthogonal to them.
        doubts: As of `solve`.
    """
    X, doubts = plan.solved(K, right)
    k = right.shape[1]
    free = plan.free
    X = X[:, [*range(k), *(k + free.index(col) for col in plan.motions)]]
    part_idle(plan, X, k)
    return X, doubts


def own_inertia(plan: ModulePlan, constant: tuple[float, ...], output: int) -> Expression:
    """Return the ten inertial numbers of an output, as constants or as arguments of the model."""
    return plain(constant) if plan.inertias is None else plan.inertias[output]


def rank_guard(plan: ModulePlan, rows: CoreRows, guard: Any, Psi: Expression) -> Any:
    """Return a guard that is also above 1 where the core's closures have more than their rank.

    Arguments may give them more at every posture, which every motion tells to rounding. Without arguments
    only other modes of the linkage have more, and one motion, a combination of all, tells.

    Args:
        rows: Rows of its closures.
        guard: The guard so far.
        Psi: Motions of the core that the rows with pivots allow, shape (n, motions).
    """
    rest = [row for row in range(len(rows.K)) if row not in plan.loop_pivots.rows]
    if not rest or not Psi.shape[1]:
        return guard
    r, unit = plan.mechanism.reduction, plan.mechanism.reduction.col_scale[plan.parts.tree_v]
    row_scale = r.row_scale[np.array(plan.parts.closure_rows)[rest]]
    if plan.column is None:
        one = dot(Psi, np.arange(1.0, 1.0 + Psi.shape[1]))
        limit = max(10.0 * plan.scale.closed, RANK_TOLERANCE)
        left = dot(rows.K[rest, 6:], one) * (row_scale / limit)
        return guard if all(map(is_zero, left)) else ca.fmax(guard, largest(left))
    without_units = Psi / unit[:, None]
    K = rows.K[rest, 6:] * row_scale[:, None] * unit
    left = largest(dot(K, without_units)) / (plan.scale.closed * (1.0 + largest(without_units)))
    return ca.fmax(guard, left)


def whole(chain: Chain, body: int, s: Expression, J: Expression) -> Expression:
    """Compute a body's acceleration for s, own frame, shape (6,)."""
    return np.asarray(plus(motion_to_body(chain.R0[body], chain.p0[body], dot(J, s)), chain.c[body]))
