"""The whole tree of a module as the kernels that close loops need it: its rods that idle, and arguments."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from ....linkage.closures import TreeClosure
from ....linkage.couplings import TreeCoupling
from ....linkage.joints import TreeJoint
from ....linkage.tree import Tree
from ....spatial import Array
from ....structure.mechanism import Mechanism
from ....structure.module_spec import ModuleSpec

if TYPE_CHECKING:
    from ...equations.rods import Rod


@dataclass(frozen=True, eq=False)
class Extended:
    """The extended tree of a mechanism.

    Attributes:
        mechanism: The mechanism.
        joints: Joints of the tree; their numbers may be arguments.
        closures: The closures after the cuts; those on rods that idle begin at the rod, in its axes.
        couplings: The couplings, with joints of the tree.
        welds: A closure for each wrist, from its end to its target.
        rods: Rods that idle, by the closure's number.
    """

    mechanism: Mechanism
    joints: tuple[TreeJoint, ...]
    closures: tuple[TreeClosure, ...]
    couplings: tuple[TreeCoupling, ...]
    welds: tuple[TreeClosure, ...]
    rods: dict[int, Rod]

    @property
    def tree(self) -> Tree:
        """The tree: first the joints of `Mechanism.tree`, then those of the wrists."""
        return self.mechanism.cut.whole

    @property
    def source(self) -> tuple[int | None, ...]:
        """For each joint its number in the spanning tree, or None for a platform."""
        return self.mechanism.spec.source

    @property
    def unit(self) -> Array:
        """Unit of each freedom, shape (nv,)."""
        return self.mechanism.unit

    @property
    def row_scale(self) -> Array:
        """Factor of each row of closures and couplings, shape (rows,)."""
        return self.mechanism.reduction.row_scale

    @property
    def length(self) -> float:
        """The module's length [m]."""
        return self.mechanism.length

    @property
    def shape(self) -> tuple[object, ...]:
        """Everything but the numbers in which modules with the same kernel may differ."""
        from ...loops.loop_rows import shape_of_rows

        closures = *self.closures, *self.welds
        rows = shape_of_rows(self.tree.joints, closures, self.couplings, self.rods)
        return rows, len(self.mechanism.tree.joints), self.source, self.length

    @property
    def weight(self) -> Array:
        """Weight of each freedom in the least norm, shape (nv,): none for wrists, which follow their ends."""
        cut = self.mechanism.tree.nv
        return np.where(np.arange(self.tree.nv) < cut, 1.0 / self.unit, 0.0)

    @property
    def platforms(self) -> tuple[int, ...]:
        """Joints that stand for platforms."""
        return tuple(i for i, source in enumerate(self.source) if source is None)


def with_arguments(m: Mechanism, spec: ModuleSpec) -> Extended:
    """Return the extended tree of a mechanism with other numbers, which may be arguments."""
    from ...equations.rigid import links_of
    from ...equations.rods import loosened
    from ...loops.loop_rows import along_rods

    e = extended(m)
    return replace(
        e,
        rods=loosened(e.rods, links_of(spec.whole), spec.cut_closures),
        joints=tuple(replace(j, R=x.R, p=x.p) for j, x in zip(e.joints, spec.whole, strict=True)),
        closures=along_rods(spec.cut_closures, e.rods),
        couplings=spec.cut_couplings,
        welds=tuple(replace(c, R_b=w.R, p_b=w.p) for c, w in zip(e.welds, spec.wrists, strict=True)),
    )


@cache
def extended(m: Mechanism) -> Extended:
    """Return the extended tree of a mechanism."""
    from ...loops.loop_rows import along_rods, idle_rods

    rods = idle_rods(m, m.spec.tree, m.spec.cut_closures)
    closures = along_rods(m.closures.closures, rods)
    return Extended(m, m.cut.whole.joints, closures, m.closures.couplings, m.cut.welds, rods)
