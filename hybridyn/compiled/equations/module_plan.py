"""Everything that is chosen about a module before its code is written: parts, pivots, scales."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ...structure.mechanism import Mechanism
from ...symbols import Expression
from .guarded_elimination import Pivots, balanced, solve
from .leg_groups import Leg
from .parts import Parts
from .scales import Scale
from .spins import Decided, decided


@dataclass(frozen=True)
class ModulePlan:
    """Everything that is chosen about a module before its code is written.

    Attributes:
        parts: Its core and its legs.
        loop_pivots: Pivots of the core's closures.
        leg_pivots: Pivots of each group's closures.
        wrist_pivots: Pivots of each wrist's Jacobian.
        scale: Scales of its closure residuals.
        inertias: Ten numbers of each output, including what regrouping moves to it, if they are arguments.
        column: Symbols of the module's arguments, or None.
    """

    parts: Parts
    loop_pivots: Pivots
    leg_pivots: tuple[Pivots, ...]
    wrist_pivots: tuple[Pivots, ...]
    scale: Scale
    inertias: tuple[Expression, ...] | None = None
    column: ca.SX | None = None

    @property
    def mechanism(self) -> Mechanism:
        """The module."""
        return self.parts.mechanism

    @property
    def free(self) -> list[int]:
        """Freedoms of the core without a pivot."""
        return [k for k in range(len(self.parts.tree_v)) if k not in self.loop_pivots.cols]

    @property
    def motions(self) -> list[int]:
        """The same in the order of the core's motions: those that stand for spins come first."""
        spins = [spin.col for spin in self.parts.spins]
        return spins + [k for k in self.free if k not in spins]

    def solved(self, K: Expression, right: Expression) -> tuple[Expression, Expression]:
        """Solve the core's closures K y = right; redundant rows of a rounded file count like the others."""
        r = self.mechanism.reduction
        if not r.rounded:
            return solve(K, right, self.loop_pivots)
        return balanced(K, right, self.loop_pivots, r.row_scale[list(self.parts.closure_rows)])

    def spinning(self, rotor: Sequence[float], leg: Leg | None = None) -> list[Decided]:
        """Decide which spins of the core, or of a leg, have inertia.

        Args:
            rotor: Rotor inertias over the freedoms of the tree after the cuts.
        """
        links, own, spins = self.parts.links, self.parts.tree_v, self.parts.spins
        if leg is not None:
            links, own, spins = leg.links, leg.tree_v, (leg.spin,) if leg.spin else ()
        turned, out = self.mechanism.turned_inertia, []
        for spin in spins:
            at = own[list(spin.cols)]
            reference = float(turned[at].max(initial=0.0) or turned.max(initial=0.0))
            out.append(decided(spin, links, np.array(rotor)[at], reference, self.scale))
        return out
