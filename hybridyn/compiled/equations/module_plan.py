"""Everything that is chosen about a module before its code is written: parts, pivots, scales."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca

from ...structure.mechanism import Mechanism
from ...symbols import Expression
from .factors import balanced
from .guarded_elimination import Pivots, solve
from .parts import Parts
from .scales import Scale


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
        posed: Its core at rest, of the constants, at which pivots are chosen (`core.PosedCore`).
    """

    parts: Parts
    loop_pivots: Pivots
    leg_pivots: tuple[Pivots, ...]
    wrist_pivots: tuple[Pivots, ...]
    scale: Scale
    inertias: tuple[Expression, ...] | None = None
    column: ca.SX | None = None
    posed: Any = None

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
        """The same in the order of the core's motions: those that stand for idle ones come first."""
        idle = [motion.col for motion in self.parts.idle]
        return idle + [k for k in self.free if k not in idle]

    @property
    def idle(self) -> int:
        """Number of the core's idle motions."""
        return len(self.parts.idle)

    def solved(self, K: Expression, right: Expression) -> tuple[Expression, Expression]:
        """Solve the core's closures K y = right; redundant rows of a rounded file count like the others."""
        r = self.mechanism.reduction
        if not r.rounded:
            return solve(K, right, self.loop_pivots)
        return balanced(K, right, self.loop_pivots, r.row_scale[list(self.parts.closure_rows)])
