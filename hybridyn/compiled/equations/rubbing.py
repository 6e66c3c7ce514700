"""Friction that grows with load in the inverse model of one module (see `dynamics.load_friction`).

Motors balance friction under a given motion, so a module's wrenches answer to its own joints alone. With the
friction n of its joints, what the law takes from their wrenches is p = p_0 + B n, and n = N(p) (`settling`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...effects.load_friction import OnLoads, against
from ...errors import ModelError
from ...linkage.closures import TreeClosure
from ...spatial import Array, cross, numpy_on_symbols, wrench_to_base
from ...structure.module import Module
from ...symbols import Expression, dot, minus, plus
from .chains import Chain, carried, carriers
from .core import Core
from .expressions import filled, numbers, plain, zeros
from .guarded_elimination import Triangular
from .module_plan import ModulePlan
from .parts import Parts

#: Entries of constant directions below this are rounding.
ROUNDED_PART = 1e-14


class LoadTerm(NamedTuple):
    """What one term of the law takes from the wrench of its joint, in the joint's child frame.

    Attributes:
        factor: Its coefficient.
        part: Orthogonal directions of wrenches, shape (k, 6), k up to 3; their length counts.
    """

    factor: float
    part: tuple[tuple[float, ...], ...]


class Rubbing(NamedTuple):
    """A joint of a module with friction that grows with its load.

    Attributes:
        joint: Its number in the whole tree.
        cols: Its freedoms in the tree after the cuts.
        terms: Those of the law.
        rise, speed, width: By how much friction is larger at rest, its Stribeck velocity, and `width`.
    """

    joint: int
    cols: tuple[int, ...]
    terms: tuple[LoadTerm, ...]
    rise: float
    speed: float
    width: float

    def effort(self, v: Expression) -> Expression:
        """Compute the efforts over its freedoms per unit of friction at their rates v."""
        with numpy_on_symbols():
            return filled(against(v, self.width, self.rise, self.speed), len(v))


def rubbing_joints(law: OnLoads | None, module: Module, parts: Parts) -> tuple[Rubbing, ...]:
    """Return the joints of a module on which friction that grows with load acts.

    Raises:
        ModelError: Friction acts along an idle motion, or inside a wrist that carries a platform.
    """
    out: list[Rubbing] = []
    spec, tree = module.mechanism.spec, module.mechanism.tree
    idle = {col for motion in parts.all_idle for col in motion.cols}
    for n, name in enumerate(() if law is None else law.joints):
        if law is None or name not in module.joints:
            continue
        joint = spec.in_whole[module.joints.index(name)]
        cols = tuple(range(*tree.v_slices[joint].indices(tree.nv))) if joint < len(spec.tree) else ()
        if not cols or idle.intersection(cols):
            where = "an idle motion turns it" if cols else "it is in a wrist that carries a platform"
            raise ModelError(
                f"the effect '{law.effect.name}' cannot be compiled on joint '{name}': {where}. Use the "
                "general path for it", element=name,
            )  # fmt: skip
        T = parts.turns[joint + 1]
        terms = tuple(
            LoadTerm(float(law.factor[k]), _in_aligned(law.part[k], T))
            for k in np.flatnonzero(law.of_joint == n)
        )
        out.append(Rubbing(
            joint, cols, terms, float(law.rise[n]), float(law.speed[n]), float(law.effect.width),
        ))  # fmt: skip
    return tuple(out)


def efforts_of(rubbing: Sequence[Rubbing], plan: ModulePlan, v: Expression) -> Expression:
    """Compute the efforts along y per unit of the friction of each joint, shape (n, joints).

    Args:
        rubbing: The joints.
        v: Rates of the spanning tree.
    """
    own, out = plan.parts.tree_v, zeros(len(plan.parts.tree_v), len(rubbing))
    place = {int(col): k for k, col in enumerate(own)}
    for j, one in enumerate(rubbing):
        at = [place[col] for col in one.cols]
        out[at, j] = one.effort(np.array([v[plan.parts.v[k]] for k in at], dtype=object))
    return out


def _in_aligned(part: Array, T: Array) -> tuple[tuple[float, ...], ...]:
    """Return what a term takes from a wrench in the axes T of the body, without rows of zeros."""
    out = T.T @ part @ np.kron(np.eye(2), T)
    out = np.where(np.abs(out) < ROUNDED_PART, 0.0, out)
    return tuple(tuple(row.tolist()) for row in out if row.any())


class WrenchAnswers(NamedTuple):
    """What the law takes from wrenches, for each term an array, and how it answers to friction.

    Attributes:
        alone: Without this friction, shape (k,).
        per_unit: Per unit of the friction of each joint, shape (k, joints).
    """

    alone: list[Expression]
    per_unit: list[Expression]


def answers(
    core: Core, plan: ModulePlan, rubbing: Sequence[Rubbing], moving: Chain, outputs: Sequence[Expression],
    left: Expression,
) -> WrenchAnswers:  # fmt: skip
    """Compute what the law takes from the wrenches of joints.

    Args:
        rubbing: The joints.
        moving: The core's motion for inertial forces.
        outputs: Wrench that each output needs, own frame.
        left: Forces along y that closures have to produce: without friction, then per unit of each joint's,
            shape (n, 1 + joints).
    """
    inertial, own = carried(moving), list[Expression]()
    for one in rubbing:
        wrench = inertial[one.joint + 1]
        for body, W in zip(core.outputs, outputs, strict=True):
            if one.joint in carriers(core.chain, body):
                wrench = wrench + seen_from(core.chain, one.joint + 1, _in_base(core.chain, body, W))
        own += [dot(plain(term.part), wrench) for term in one.terms]
    through = rows_of_terms(rubbing, dot(through_closures(core, plan, rubbing), left))
    alone = [plus(x, taken[:, 0]) for x, taken in zip(own, through, strict=True)]
    return WrenchAnswers(alone, [taken[:, 1:] for taken in through])


def _in_base(chain: Chain, body: int, W: Expression) -> Expression:
    """Transform a wrench on a body from its frame to the base's."""
    return wrench_to_base(chain.R0[body], chain.p0[body], W)


def seen_from(chain: Chain, body: int, W: Expression) -> Expression:
    """Transform a wrench from the base's frame to a body's."""
    R, p = chain.R0[body], chain.p0[body]
    return np.concatenate([dot(R.T, W[:3]), dot(R.T, minus(W[3:], cross(p, W[:3])))])


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


def terms_of(rubbing: Sequence[Rubbing]) -> list[tuple[int, float, int]]:
    """Return the number of its joint, the factor and the number of rows of each term."""
    return [(i, term.factor, len(term.part)) for i, one in enumerate(rubbing) for term in one.terms]


def rows_of_terms(rubbing: Sequence[Rubbing], rows: Expression) -> list[Expression]:
    """Split what all terms take, shape (rows, ...), by term."""
    ends = np.cumsum([size for _, _, size in terms_of(rubbing)])
    return np.split(rows, ends[:-1])
