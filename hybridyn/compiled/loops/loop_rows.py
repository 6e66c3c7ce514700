"""All rows of the loops of modules of one shape over their spanning tree, and the choice of its pivots."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from ...linkage.closures import TreeClosure
from ...linkage.couplings import CouplingRows, TreeCoupling
from ...linkage.joints import TreeJoint
from ...linkage.tree import Tree
from ...spatial import Array
from ...structure.mechanism import Mechanism
from ...structure.module import Module
from ...structure.module_spec import ModuleSpec
from ...symbols import Expression, dot
from ..equations.expressions import Folding, numbers, sampled, scalar, symbols, zeros
from ..equations.guarded_elimination import Pivots, choose_pivots
from ..equations.idle.motion import idle_motions
from ..equations.legs import fold_links
from ..equations.rigid import Links, links_of
from ..equations.rods import Rod, is_ball, loosened, rods_of
from ..equations.states import generic_positions
from .spanning_rows import SpanningRows

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
    rows = shape_of_rows(spec.spanning, spec.closures, spec.couplings, spanning_rods(module.mechanism))
    return rows, module.mobility, module.mechanism.length, *more


def shape_of_rows(
    joints: Sequence[TreeJoint],
    closures: Sequence[TreeClosure],
    couplings: Sequence[TreeCoupling],
    rods: Mapping[int, Rod],
) -> tuple[object, ...]:
    """Return everything but the numbers in which trees with the same code of their rows may differ."""
    return (
        tuple((j.kind, j.parent, tuple(j.axis.tolist())) for j in joints),
        tuple((c.body_a, c.body_b, c.translations, c.rotation) for c in closures),
        tuple(c.form for c in couplings),
        tuple((k, rod.on_a, rod.turns) for k, rod in rods.items()),
    )


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

    def __init__(self, links: Links, q: Expression, v: Expression | None) -> None:
        """Begin without rows.

        Args:
            links: Those of the tree.
            q, v: Its positions, and given rates or None.
        """
        self.tree = Tree([*links.values()])
        self.K, self.residual = zeros(0, self.tree.nv), zeros(0)
        self.rates, self.drift = zeros(0), zeros(0)
        self.writer, self._v = SpanningRows(self.tree, q, v), v
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

    def close(self, closure: TreeClosure) -> None:
        """Add the rows of a closure."""
        self._add(closure, *self.writer.closure(closure))

    def _add(self, closure: TreeClosure, residual: Expression, K: Expression) -> None:
        """Add rows; the change of a ball's is that of its points, once their velocities are one."""
        if self._v is None:
            self.add(K, residual)
        elif is_ball(closure):
            self.add(K, residual, zeros(3), self.writer.drift(closure))
        else:
            self.add(K, residual, self.writer.rates(closure))

    def close_all(
        self,
        closures: Sequence[Sequence[TreeClosure]],
        couplings: Sequence[Sequence[TreeCoupling]],
        rods: Mapping[int, Rod],
        folding: Folding,
        q: Expression,
    ) -> None:
        """Add the rows of all closures and couplings of several modules, at positions of their tree."""
        for k, same in enumerate(zip(*closures, strict=True)):
            own, rod = folded(folding, same), rods.get(k)
            if rod is None:
                self.close(own)
            else:
                on_line = not any(c.p_a.dtype == object for c in same)
                self._add(own, *self.writer.on_rod(own, rod.turns, on_line, exact=self.exact))
        coupled = [
            same[0]._replace(offset=folding.array([scalar(c.offset) for c in same]))
            for same in zip(*couplings, strict=True)
        ]
        written = CouplingRows(self.tree, coupled)
        K = numbers(written.matrix(q[None])).reshape(-1, self.tree.nv)
        self.add(K, written.residual(q[None])[0])


def folded(folding: Folding, same: Sequence[TreeClosure]) -> TreeClosure:
    """Return a closure that represents those of several modules."""
    R_a, p_a, R_b, p_b = (
        folding.array([getattr(c, name) for c in same]) for name in ("R_a", "p_a", "R_b", "p_b")
    )
    return replace(same[0], R_a=R_a, p_a=p_a, R_b=R_b, p_b=p_b)


def idle_rods(m: Mechanism, joints: tuple[TreeJoint, ...], closures: Sequence[TreeClosure]) -> dict[int, Rod]:
    """Return the rods of closures of a module's tree if some have idle motions, by the closure's number."""
    return rods_of(links_of(joints), closures) if idle_motions(m, ()) else {}


@cache
def spanning_rods(m: Mechanism) -> dict[int, Rod]:
    """Return the rods of closures of a module's spanning tree (`idle_rods`)."""
    return idle_rods(m, m.spec.spanning, m.spec.closures)


def fewest_turns(rods: Sequence[dict[int, Rod]]) -> dict[int, Rod]:
    """Return rods of modules of one shape, each with the turns that are left out of all its rows."""
    return {k: min((own[k] for own in rods), key=lambda rod: len(rod.turns)) for k in rods[0]}


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
    specs = specs or [module.mechanism.spec for module in modules]
    links = fold_links(folding, [links_of(s.spanning) for s in specs])
    rods = [
        loosened(spanning_rods(module.mechanism), links_of(s.spanning), s.closures)
        for module, s in zip(modules, specs, strict=True)
    ]
    closures = [along_rods(s.closures, own) for s, own in zip(specs, rods, strict=True)]
    out = LoopRows(links, q, v)
    out.close_all(closures, [s.couplings for s in specs], fewest_turns(rods), folding, q)
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
    rank, unit = m.spanning_rank, m.spanning_col_scale.copy()
    unit[list(last)] *= LAST
    return choose_pivots(K, rank, m.spanning_row_scale, unit, SPARSE_SPANNING)
