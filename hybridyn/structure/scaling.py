"""Compute the length of a module, the scales of its closures and freedoms, and the blocks of its legs."""

from __future__ import annotations

import numpy as np

from ..linkage.closures import Closures
from ..linkage.reduction import Block, Reduction
from ..linkage.tree import Tree
from ..spatial import Array
from .module_spec import ModuleSpec


def module_length(spec: ModuleSpec, spanning: Tree, robot_size: float) -> float:
    """Compute the extent of a module at home [m], rounded to a power of two so that scaling is exact.

    Args:
        spec: Numbers of the module.
        spanning: Spanning tree of the module.
        robot_size: Characteristic length of the robot [m], for modules that have no extent themselves.
    """
    motion = spanning.sweep(spec.home[None])
    points = [motion.p[0, b] for b in range(len(spanning.joints) + 1)]
    points = points[1:] or points
    for c in spec.closures:
        points.append(motion.p[0, c.body_a] + motion.R[0, c.body_a] @ c.p_a)
        points.append(motion.p[0, c.body_b] + motion.R[0, c.body_b] @ c.p_b)
    extent = float(np.linalg.norm(np.ptp(np.array(points), axis=0)))
    extent = extent or float(np.linalg.norm(points[0])) or robot_size
    return float(2.0 ** np.round(np.log2(extent)))


def freedom_units(tree: Tree, length: float) -> Array:
    """Return the unit of each freedom, shape (nv,): `length` if it is linear, else one radian."""
    linear = np.abs(tree.S_linear).max(axis=1, initial=0.0) > 0
    return np.where(linear, length, 1.0)


def row_factors(tree: Tree, closures: Closures, length: float) -> Array:
    """Compute the factor that makes each closure row dimensionless, shape (rows,)."""
    out = np.where(closures.is_angle, 1.0, 1.0 / length)
    unit = freedom_units(tree, length)
    for i, coupling in enumerate(closures.couplings):
        at = closures.row_slices[len(closures.closures) + i]
        sizes = [abs(k) * unit[tree.v_slices[j].start] for j, k in coupling.terms]
        out[at] = 1.0 / 2.0 ** np.round(np.log2(max(sizes)))
    return out


def leg_by_leg(spec: ModuleSpec, tree: Tree, closures: Closures, length: float) -> Reduction:
    """Build the elimination of a module's closures on the tree after the cuts, without fixed ranks."""
    slices = [tree.v_slices[i] for i in spec.platforms]
    shared = np.array([c for s in slices for c in range(s.start, s.stop)], dtype=int)
    scales = row_factors(tree, closures, length), freedom_units(tree, length)
    return Reduction(*scales, _blocks(spec, tree, closures), shared)


def _blocks(spec: ModuleSpec, tree: Tree, closures: Closures) -> list[Block]:
    """Return the rows and columns of each leg; a row belongs to the leg that it constrains."""
    leg_of = {body: i for i, leg in enumerate(spec.legs) for body in leg}
    rows: list[list[int]] = [[] for _ in spec.legs]
    for c, at in zip(closures.closures, closures.row_slices, strict=False):
        leg = leg_of.get(c.body_a, leg_of.get(c.body_b))
        if leg is not None:
            rows[leg] += range(at.start, at.stop)
    for i, coupling in enumerate(closures.couplings):
        at = closures.row_slices[len(closures.closures) + i]
        rows[leg_of[coupling.terms[0][0] + 1]] += range(at.start, at.stop)
    cols = [[c for b in leg for c in range(tree.nv)[tree.v_slices[b - 1]]] for leg in spec.legs]
    return [Block(np.array(r, dtype=int), np.array(c, dtype=int)) for r, c in zip(rows, cols, strict=True)]
