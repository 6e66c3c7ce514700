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

from ..errors import AssemblyError
from ..linkage.retraction import Retraction
from ..spatial import Array, Index
from ..structure.module import Module
from .branch import LOST_RATES, Branch, branch_of, derivative
from .loop_rows import LoopRows

#: Newton has converged after a step of at most this (rad, module lengths); the next one would be rounding.
LAST_STEP = 1e-12
#: Largest residual of closed loops (relative to the module's length), in addition to rounding of the file.
CHART_CLOSED = 1e-11
#: Maximum number of Newton steps; if more are needed, the time step has to be shorter.
MOST_STEPS = 20
#: Largest displacement of dependent coordinates within a chart (rad, module lengths).
FARTHEST = 1.0
#: Closures are close to losing rank if their least singular value is below this part of its generic value.
CLOSE = 1.0
#: Another branch may be near if G's least singular value is below this part of its generic value.
NARROW = 0.2
#: In that case, largest ratio of Newton's second step to its first.
CONTRACTION = 0.25
#: Residuals below this are rounding: where closures lose rank, a Newton step from them is meaningless.
CHART_ROUNDING = 2e-15
#: Singular values below this part of the largest are dropped where positions are not resolved.
HELD = 1e-3


class AmbiguousBranchError(AssemblyError):
    """Another branch of assembled postures is too near to identify the branch of a motion."""


@dataclass(frozen=True)
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


@dataclass(frozen=True)
class LoopedModule:
    """A module with loops.

    Attributes:
        module: The module.
        rows: Its closures.
        retraction: Moves on its spanning tree.
    """

    module: Module
    rows: LoopRows
    retraction: Retraction

    @property
    def closed(self) -> float:
        """Largest scaled residual of an assembled posture."""
        return CHART_CLOSED + self.module.mechanism.rounding


@dataclass(frozen=True)
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


class _Part:
    """The part of a chart that belongs to one looped module."""

    def __init__(self, looped: LoopedModule, q: Array, v: Array | None) -> None:
        self.looped, self.q = looped, q
        self.unit = looped.rows.unit
        _, K = looped.rows.at(q)
        r = looped.rows.rank
        parts = U, s, Vt = np.linalg.svd(K)
        branch = None if v is None else self._branch(K, v / self.unit, parts)
        if branch is None:
            self.U, self.V, self.Z = U[:, :r], Vt[:r].T, Vt[r:].T
        else:
            self.U, self.V, self.Z = branch.U, branch.V, branch.Z
        self.pivot = float(s[r - 1] / s[0]) if r and s[0] > 0 else 1.0
        self.w = np.zeros(r)
        self.G = self.V.T @ self.V
        self.K = K
        self.narrow, self.lost = False, False

    def _branch(self, K: Array, v: Array, parts: tuple[Array, Array, Array]) -> Branch | None:
        """Compute the branch of scaled rates where closures lose rank; None elsewhere."""
        rows, move = self.looped.rows, self.looped.retraction.move

        def along(direction: Array) -> Array:
            return derivative(lambda s: rows.at(move(self.q, s * direction * self.unit))[1])

        return branch_of(K, rows.rank, v, along, self.looped.module.name, parts)

    def lift(self, y: Array, near: Array | None = None) -> tuple[Array, Array]:
        """Solve for displacement and positions at independent coordinates y, from a scaled guess `near`.

        Raises:
            AssemblyError: The loops do not close there.
            AmbiguousBranchError: Another branch is too near.
        """
        looped, w, lengths = self.looped, self.w.copy() if near is None else self.V.T @ near, [np.inf]
        along = self.Z @ y
        for _ in range(MOST_STEPS):
            q = looped.retraction.move(self.q, self.unit * (along + self.V @ w))
            residual, K = looped.rows.at(q)
            open_by = float(np.abs(residual).max())
            G = self.U.T @ K @ self.V
            step = self._newton_step(G, residual)
            lengths.append(float(np.abs(step).max(initial=0.0)))
            if open_by <= CHART_ROUNDING and lengths[-1] > LAST_STEP:
                step, lengths[-1] = 0.0 * w, 0.0
            if lengths[-1] <= LAST_STEP or (lengths[-1] >= lengths[-2] and open_by <= looped.closed):
                if open_by > looped.closed:
                    break
                self._check_branch(G, lengths)
                self.w, self.G, self.K = w - step, G, K
                xi = self.unit * (along + self.V @ self.w)
                return xi, looped.retraction.move(self.q, xi)
            w = w - step
            if not np.isfinite(lengths[-1]) or np.abs(w).max() > FARTHEST:
                break
        raise AssemblyError(
            f"module '{looped.module.name}': its loops do not close {np.abs(along).max(initial=0.0):.2g} "
            f"(rad or module lengths) away along its free motions; {len(lengths) - 1} Newton steps left a "
            f"residual of {open_by:.2g} (limit {looped.closed:.0e}). The posture is out of reach, or the "
            "step too long",
            module=looped.module.name,
            residual=open_by,
            iterations=len(lengths) - 1,
        )

    def _newton_step(self, G: Array, residual: Array) -> Array:
        """Compute the Newton step of the dependent coordinates.

        Raises:
            AmbiguousBranchError: G is singular, and the loops are open.
        """
        if not len(G):
            return self.w
        try:
            return np.asarray(np.linalg.solve(G, self.U.T @ residual), dtype=float)
        except np.linalg.LinAlgError:
            if np.abs(residual).max() <= CHART_ROUNDING:
                return np.zeros(len(G))
            raise self._ambiguous() from None

    def _check_branch(self, G: Array, lengths: list[float]) -> None:
        """Check that Newton stayed on the branch; update `narrow` and `lost`.

        Raises:
            AmbiguousBranchError: G is nearly singular, and Newton did not contract from its first step on.
        """
        s = np.linalg.svd(G, compute_uv=False) if len(G) else np.ones(1)
        usual = self.looped.module.mechanism.reduction.report.kept
        self.narrow, self.lost = s[-1] <= NARROW * usual * s[0], s[-1] <= LOST_RATES * s[0]
        if self.narrow and len(lengths) > 2 and lengths[2] > CONTRACTION * lengths[1]:
            raise self._ambiguous()

    def _ambiguous(self) -> AmbiguousBranchError:
        name = self.looped.module.name
        return AmbiguousBranchError(
            f"module '{name}': its closures lose rank (constraint singularity) so near that its branch "
            "cannot be distinguished from the others that meet there",
            module=name,
        )

    def close(self) -> Array:
        """Compute closed positions near the origin; weak rows are ignored if the others close the loops.

        Raises:
            AssemblyError: There are none.
        """
        if self.pivot <= HELD:
            q = self.q
            for _ in range(MOST_STEPS):
                residual, K = self.looped.rows.at(q)
                step = self.V @ (np.linalg.pinv(self.U.T @ K @ self.V, rcond=HELD) @ (self.U.T @ residual))
                q = self.looped.retraction.move(q, -self.unit * step)
                if np.abs(step).max() <= LAST_STEP:
                    break
            if np.abs(residual).max() <= self.looped.closed:
                return q
        return self.lift(np.zeros(self.Z.shape[1]), np.zeros(len(self.unit)))[1]

    def rates(self, u: Array) -> Array:
        """Compute the scaled rates at the posture of the last `lift`, u of shape (N,) or (N, k).

        Where rank is lost, rows that are rounding are dropped, and rates keep the chart's direction.
        """
        along = self.Z @ u
        right = self.U.T @ (self.K @ along)
        inverse = np.linalg.pinv(self.G, rcond=HELD) if self.lost else None
        dependent = np.linalg.solve(self.G, right) if inverse is None else inverse @ right
        out: Array = along - self.V @ dependent
        return out


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
            _Part(m, q[m.module.q_index], None if v is None else v[m.module.v_index]) for m in self._looped
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
