"""The spins of a module whose joints follow its motors: none of them does.

Psi = [S, ...] begins with the spins, so v = E m_dot + S sigma_dot, and sigma_dot and sigma_ddot stay. All
these motions commute but for spins: v_E - E_v + [v, E] = S lambda with derivatives along each other. These
are orthogonal to the spins, as share^T E = 0 and share^T S = 1 are constant, so that
lambda = share^T [v, E].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ....structure.module import Module
from ....symbols import Expression, dot
from ..module_plan import ModulePlan


def idle_in_v(plan: ModulePlan, module: Module) -> list[list[int]]:
    """Return the freedoms in v of the joint of each idle motion: a module's first motions, in order."""
    at = module.v_index[module.mechanism.cut.v_in]
    return [at[list(spin.cols)].tolist() for spin in plan.parts.all_idle]


@dataclass(frozen=True, eq=False)
class IdleOverMotors:
    """The idle motions of a module over its motors.

    Attributes:
        spins: Of each the freedoms of its joint, and their share.
    """

    spins: tuple[tuple[tuple[int, ...], tuple[float, ...]], ...]

    @property
    def key(self) -> tuple[object, ...]:
        """What is equal for modules that share their code."""
        return self.spins

    @classmethod
    def of(cls, plan: ModulePlan, module: Module, freedoms: Sequence[int]) -> IdleOverMotors:
        """Return those of a module; freedoms are numbered among some in v."""
        number = {k: i for i, k in enumerate(freedoms)}
        joints, shares = idle_in_v(plan, module), [spin.share for spin in plan.parts.all_idle]
        spins = [
            (tuple(number[k] for k in at), tuple(map(float, share)))
            for at, share in zip(joints, shares, strict=True)
        ]
        return cls(tuple(spins))

    def taken_out(self, T: Expression, S: Expression, bracket: Expression, rest: list[int]) -> Expression:
        """Return T + [v, E] of some freedoms without what is along the idle motions.

        Args:
            T: With [v, E] added, shape (len(rest),).
            S: Rates of all freedoms along each idle motion, shape (motions, nv).
            bracket: [v, E], shape (nv,).
            rest: The freedoms.
        """
        for spun, (at, share) in zip(S, self.spins, strict=True):
            T = T - spun[rest] * dot(np.array(share, dtype=object), bracket[list(at)])
        return T
