"""All closures of modules of one shape on their spanning trees, and the choice of dependent coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from ...structure.module import Module
from ...structure.module_spec import ModuleSpec
from .chains import sweep
from .expressions import Expression, Folding, pack, scalar, symbols, zeros
from .legs import fold_links
from .loops import SpanningRows, coupling_row
from .rigid import links_of
from .states import generic_positions
from .static_elimination import Pivots, choose_pivots

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
    couplings = tuple(c.terms for c in spec.couplings)
    return joints, closures, couplings, module.mobility, module.mechanism.length, *more


def spanning_closures(
    modules: list[Module], folding: Folding, q: Expression, specs: Sequence[ModuleSpec] = ()
) -> tuple[Expression, Expression]:
    """Compute the Jacobian, shape (rows, nv), and residual, shape (rows,), of all closures.

    Args:
        modules: Modules of one shape.
        folding: Collects the numbers in which they differ.
        q: Positions of the spanning tree.
        specs: The modules' numbers where some are arguments.
    """
    tree = modules[0].mechanism.spanning
    positions = [q[at] for at in tree.q_slices]
    specs = specs or [module.mechanism.spec for module in modules]
    links = fold_links(folding, [links_of(s.spanning, [np.zeros(10)] * len(s.spanning)) for s in specs])
    nv = sum(link.nv for link in links)
    chain = sweep(links, q, zeros(nv), zeros(6))
    rows = SpanningRows(chain)
    residual, K = [zeros(0)], [zeros(0, nv)]
    for same in zip(*(s.closures for s in specs), strict=True):
        frames = [folding.array([getattr(c, name) for c in same]) for name in ("R_a", "p_a", "R_b", "p_b")]
        off, over = rows.closure(same[0], (frames[0], frames[1], frames[2], frames[3]))
        residual, K = [*residual, off], [*K, over]
    for coupled in zip(*(s.couplings for s in specs), strict=True):
        offset = folding.array([scalar(c.offset) for c in coupled])[0]
        miss, row = coupling_row(chain, coupled[0], positions, offset)
        residual, K = [*residual, np.array([miss], dtype=object)], [*K, row[None]]
    return np.concatenate(K), np.concatenate(residual)


def dependent_pivots(modules: list[Module], last: Sequence[int] = ()) -> Pivots:
    """Choose dependent coordinates with large pivots at generic postures of all modules of a shape.

    Args:
        last: Freedoms that should stay independent if possible.
    """
    m, folding = modules[0].mechanism, Folding()
    q_col, q = symbols("q", m.spanning.nq)
    K, _ = spanning_closures(modules, folding, q)
    function = ca.Function("K", [q_col, folding.symbol()], [pack(K)])
    table = folding.table(len(modules))
    samples = [
        np.array(function(posture, numbers)).reshape(K.shape)
        for module, numbers in zip(modules, table, strict=True)
        for posture in generic_positions(module)
    ]
    rank, unit = m.spanning.nv - m.mobility, m.spanning_col_scale.copy()
    unit[list(last)] *= LAST
    return choose_pivots(np.array(samples), rank, m.spanning_row_scale, unit, SPARSE_SPANNING)
