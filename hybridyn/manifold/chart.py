"""Charts of the assembled postures: independent coordinates about one posture, and how they are lifted.

A chart is laid at the start of a step and kept through it. With the scaled closure rows K of a module there,
K = U_1 s V_1^T on their rank, and Z the null space:

    xi = unit (Z y + V_1 w),    U_1^T residual(move(q_0, xi)) = 0      positions, solved for w by Newton
    v  = unit (Z u - V_1 G^-1 U_1^T K Z u),    G = U_1^T K V_1         rates: K v = 0 and Z^T v / unit = u

so y and u are the module's independent coordinates and velocities, and the paper's Psi is the matrix before
u. A module without loops has Z = 1. The base of a "moving" robot is prescribed and no part of a chart.

Where closures lose rank, branches of assembled postures meet, and G is singular. A chart laid there is that
of the branch that the velocity is on (`branch.py`). Beyond, Newton starts from where the motion is heading
and must contract at once: then it found the branch that the motion is on, else the posture is ambiguous, and
the step is taken otherwise.
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

#: Newton stops once its step (rad, module lengths) is no more than this; the next one would be rounding.
LAST_STEP = 1e-12
#: Closures count as closed under this residual (relative to the module's length), on top of the file's
#: rounding.
CHART_CLOSED = 1e-11
#: Most Newton steps; a chart that needs more is left by a shorter time step.
MOST_STEPS = 20
#: A displacement of dependent coordinates beyond this (rad, module lengths) has left the chart.
FARTHEST = 1.0
#: Closures are close to losing rank where their least singular value is below this part of what is usual.
CLOSE = 1.0
#: Where G's least singular value is below this part of what is usual, another branch may be near.
NARROW = 0.2
#: There Newton's second step must be no more than this part of the first.
CONTRACTION = 0.25
#: Residuals below this are rounding: where closures lose rank, a step that follows them leads astray.
CHART_ROUNDING = 2e-15
#: Singular values below this part of the largest are left alone where positions cannot be told apart.
HELD = 1e-3


class AmbiguousBranchError(AssemblyError):
    """Another branch of assembled postures is too near to tell which one a motion is on."""


@dataclass(frozen=True)
class Posture:
    """A point of the manifold with its rates, as a chart gives it.

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
    """A module with loops, as the manifold sees it.

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
    """What every chart of one robot needs.

    Attributes:
        looped: Modules with loops.
        free: Freedoms of the modules without loops, shape (k,).
        unit: Unit of each freedom, shape (nv,).
        retraction: Moves on the whole spanning tree.
        prescribed: Number of the first freedoms that are prescribed: 6 for a "moving" base, else 0.
    """

    looped: Sequence[LoopedModule]
    free: Index
    unit: Array
    retraction: Retraction
    prescribed: int


class _Part:
    """A chart's share of one looped module."""

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
        """Return the branch that scaled rates are on, where closures lose rank."""
        rows, move = self.looped.rows, self.looped.retraction.move

        def along(direction: Array) -> Array:
            return derivative(lambda s: rows.at(move(self.q, s * direction * self.unit))[1])

        return branch_of(K, rows.rank, v, along, self.looped.module.name, parts)

    def lift(self, y: Array, near: Array | None = None) -> tuple[Array, Array]:
        """Give displacement and positions at independent coordinates y, starting near a scaled displacement.

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
                self._refuse_ambiguous(G, lengths)
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
        """Return the step of the dependent coordinates.

        Raises:
            AmbiguousBranchError: There is none, and the loops are open.
        """
        if not len(G):
            return self.w
        try:
            return np.asarray(np.linalg.solve(G, self.U.T @ residual), dtype=float)
        except np.linalg.LinAlgError:
            if np.abs(residual).max() <= CHART_ROUNDING:
                return np.zeros(len(G))
            raise self._ambiguous() from None

    def _refuse_ambiguous(self, G: Array, lengths: list[float]) -> None:
        """Refuse postures at which Newton may have left the branch; remember whether others are near.

        Raises:
            AmbiguousBranchError: G is small, and Newton did not contract from its first step on.
        """
        s = np.linalg.svd(G, compute_uv=False) if len(G) else np.ones(1)
        usual = self.looped.module.mechanism.reduction.report.kept
        self.narrow, self.lost = s[-1] <= NARROW * usual * s[0], s[-1] <= LOST_RATES * s[0]
        if self.narrow and len(lengths) > 2 and lengths[2] > CONTRACTION * lengths[1]:
            raise self._ambiguous()

    def _ambiguous(self) -> AmbiguousBranchError:
        name = self.looped.module.name
        return AmbiguousBranchError(
            f"module '{name}': its closures lose rank (constraint singularity) so near that the branch it "
            "moves on cannot be told from the others that meet there",
            module=name,
        )

    def close(self) -> Array:
        """Return the closed positions next to the origin; weak rows are left alone, if that closes the loops.

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
        """Return the scaled rates at the posture that `lift` gave last, u of shape (N,) or (N, k).

        Where rank is lost, rows that are rounding have no say: rates keep the chart's direction there.
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
        pivot: Least relative singular value of the closures that counts: near zero, they are about to lose
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
        """Return the independent share of rates, accelerations or displacements, shape (nv,) or (nv, k)."""
        unit = self._space.unit if x.ndim == 1 else self._space.unit[:, None]
        scaled = x / unit
        return np.concatenate(
            [scaled[self._free]] + [p.Z.T @ scaled[i] for p, i in zip(self._parts, self._held, strict=True)]
        )

    def at_origin(self, u: Array) -> Array:
        """Return the rates at the chart's origin, shape (nv,) or (nv, k)."""
        return self._spread(u, [p.Z @ u[at] for p, at in zip(self._parts, self._at, strict=True)])

    @property
    def close_to_lost_rank(self) -> bool:
        """True where the closures are closer to losing rank than they usually are."""
        return any(
            part.pivot < CLOSE * part.looped.module.mechanism.reduction.report.kept for part in self._parts
        )

    @property
    def narrow(self) -> bool:
        """True where another branch may be near the posture that `lift` gave last."""
        return any(part.narrow for part in self._parts)

    def close(self) -> Array:
        """Return the closed posture next to the origin, shape (nq,).

        Raises:
            AssemblyError: There is none.
        """
        q = self.q.copy()
        for looped, part in zip(self._looped, self._parts, strict=True):
            q[looped.module.q_index] = part.close()
        return q

    def lift(self, y: Array, u: Array, near: Array | None = None) -> Posture:
        """Return posture and rates at independent coordinates and velocities.

        Args:
            y: Coordinates, shape (N,).
            u: Velocities, shape (N,).
            near: A displacement near the posture's, from which it is solved for, shape (nv,); the last
                posture's where left out.

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
        """Return the rates of u at the posture that `lift` gave last, shape (nv,) or (nv, k)."""
        return self._spread(u, [p.rates(u[at]) for p, at in zip(self._parts, self._at, strict=True)])

    def _spread(self, u: Array, held: list[Array]) -> Array:
        """Enter scaled shares into the whole robot's freedoms."""
        out = np.zeros((len(self._space.unit), *u.shape[1:]))
        out[self._free] = u[: len(self._free)]
        for index, x in zip(self._held, held, strict=True):
            out[index] = x
        return out * (self._space.unit if u.ndim == 1 else self._space.unit[:, None])
