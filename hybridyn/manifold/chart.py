"""Charts of the manifold of assembled postures: independent coordinates about one posture, and their lift.

A chart is built at the start of a time step and kept during it. With the scaled closure rows K of a module
there, K = U_1 s V_1^T on their rank, and Z the null space:

    xi = unit (Z y + V_1 w),    U_1^T residual(move(q_0, xi)) = 0      positions, solved for w by Newton
    v  = unit (Z u - V_1 G^-1 U_1^T K Z u),    G = U_1^T K V_1         rates: K v = 0 and Z^T v / unit = u

so y and u are the module's independent coordinates and velocities, and the paper's Psi is the matrix that
multiplies u. A module without loops has Z = 1. The prescribed base of a "moving" robot is not in the chart.

Where closures lose rank, branches of assembled postures meet, and G is singular. A chart built there belongs
to the branch of the velocity (`branch.py`). Near such postures, Newton starts from the extrapolated motion
and must contract from its first step on, which shows that it converges to the branch of the motion. Else the
posture is ambiguous, and the caller has to change the step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..linkage.retraction import Retraction
from ..spatial import Array, Index
from .module_chart import LoopedModule, ModuleChart

#: Closures are close to losing rank if their least singular value is below this part of its generic value.
CLOSE = 1.0


@dataclass(frozen=True, eq=False)
class Posture:
    """A point of the manifold with its rates, computed by a chart.

    Attributes:
        q: Positions, shape (nq,).
        xi: Displacement from the chart's origin, shape (nv,).
        v: Rates, shape (nv,).
    """

    q: Array
    xi: Array
    v: Array


@dataclass(frozen=True, eq=False)
class Space:
    """Data shared by all charts of one robot.

    Attributes:
        looped: Modules with loops.
        free: Indices of the freedoms of modules without loops, shape (k,).
        unit: Unit of each freedom, shape (nv,).
        retraction: Moves on the whole spanning tree.
        prescribed: Number of leading freedoms that are prescribed: 6 for a "moving" base, else 0.
    """

    looped: Sequence[LoopedModule]
    free: Index
    unit: Array
    retraction: Retraction
    prescribed: int


class Chart:
    """Independent coordinates about one posture.

    Attributes:
        q: The origin, shape (nq,).
        size: Number of independent coordinates.
        pivot: Smallest relative singular value within the rank: near zero, the closures are close to losing
            rank.
    """

    def __init__(self, space: Space, q: Array, v: Array | None, bound: bool) -> None:
        self._space, self.q = space, q.copy()
        self._looped = space.looped if bound else []
        held = [m.module.v_index for m in self._looped]
        self._free = space.free if bound else np.arange(space.prescribed, len(space.unit))
        self._parts = [
            ModuleChart(m, q[m.module.q_index], None if v is None else v[m.module.v_index])
            for m in self._looped
        ]
        self._held = held
        ends = np.cumsum([len(self._free)] + [p.Z.shape[1] for p in self._parts])
        self._at = [slice(int(a), int(b)) for a, b in pairwise(ends)]
        self.size = int(ends[-1])
        self.pivot = min((p.pivot for p in self._parts), default=1.0)

    def independent(self, x: Array) -> Array:
        """Project rates, accelerations or displacements, (nv,) or (nv, k), on the independent coordinates."""
        unit = self._space.unit if x.ndim == 1 else self._space.unit[:, None]
        scaled = x / unit
        return np.concatenate(
            [scaled[self._free]] + [p.Z.T @ scaled[i] for p, i in zip(self._parts, self._held, strict=True)]
        )

    def at_origin(self, u: Array) -> Array:
        """Compute the rates at the chart's origin, shape (nv,) or (nv, k)."""
        return self._spread(u, [p.Z @ u[at] for p, at in zip(self._parts, self._at, strict=True)])

    @property
    def close_to_lost_rank(self) -> bool:
        """Whether the closures are closer to losing rank than at generic postures."""
        return any(
            part.pivot < CLOSE * part.looped.module.mechanism.reduction.report.kept for part in self._parts
        )

    @property
    def narrow(self) -> bool:
        """Whether another branch may be near the posture of the last `lift`."""
        return any(part.narrow for part in self._parts)

    def close(self) -> Array:
        """Compute a closed posture near the origin, shape (nq,).

        Raises:
            AssemblyError: There is none.
        """
        q = self.q.copy()
        for looped, part in zip(self._looped, self._parts, strict=True):
            q[looped.module.q_index] = part.close()
        return q

    def lift(self, y: Array, u: Array, near: Array | None = None) -> Posture:
        """Compute posture and rates at independent coordinates and velocities.

        Args:
            y: Coordinates, shape (N,).
            u: Velocities, shape (N,).
            near: Initial guess of the displacement, shape (nv,); that of the last posture by default.

        Raises:
            AssemblyError: The loops do not close there.
            AmbiguousBranchError: Another branch is too near.
        """
        unit = self._space.unit
        xi = np.zeros(len(unit))
        xi[self._free] = y[: len(self._free)] * unit[self._free]
        q = self._space.retraction.move(self.q, xi)
        for looped, part, index, at in zip(self._looped, self._parts, self._held, self._at, strict=True):
            guess = None if near is None else near[index] / part.unit
            xi[index], q[looped.module.q_index] = part.lift(y[at], guess)
        return Posture(q, xi, self.rates(u))

    def rates(self, u: Array) -> Array:
        """Compute the rates of u at the posture of the last `lift`, shape (nv,) or (nv, k)."""
        return self._spread(u, [p.rates(u[at]) for p, at in zip(self._parts, self._at, strict=True)])

    def _spread(self, u: Array, held: list[Array]) -> Array:
        """Assemble the scaled parts into rates of the whole robot."""
        out = np.zeros((len(self._space.unit), *u.shape[1:]))
        out[self._free] = u[: len(self._free)]
        for index, x in zip(self._held, held, strict=True):
            out[index] = x
        return out * (self._space.unit if u.ndim == 1 else self._space.unit[:, None])
