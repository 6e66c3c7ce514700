"""The part of a chart that belongs to one module with loops: Newton's method, and the check of its branch."""

import numpy as np

from ..errors import AssemblyError
from ..spatial import Array
from ..structure.module import Module
from .branch import LOST_RATES, branch_of, derivative
from .loop_rows import ScaledLoopRows

#: Newton has converged after a step of at most this (rad, module lengths); the next one would be rounding.
LAST_STEP = 1e-12
#: Maximum number of Newton steps; if more are needed, the time step has to be shorter.
MOST_STEPS = 20
#: Largest displacement of dependent coordinates within a chart (rad, module lengths).
FARTHEST = 1.0
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


class ModuleChart:
    """The part of a chart that belongs to one looped module."""

    def __init__(self, module: Module, rows: ScaledLoopRows, q: Array, v: Array | None) -> None:
        self.module, self.rows, self.q = module, rows, q
        _, K = self.rows.at(q)
        r = self.rows.rank
        parts = _, s, _ = np.linalg.svd(K)
        rates = np.zeros(K.shape[1]) if v is None else v / self.rows.unit

        def along(direction: Array) -> Array:
            """Differentiate the rows along a direction of scaled rates."""
            return derivative(lambda s: rows.at(rows.moved(q, s * direction))[1])

        self.U, self.V, self.Z, _ = branch_of(K, r, rates, along, module.name, parts)
        self.pivot = float(s[r - 1] / max(s[0], 1.0)) if r else 1.0  # 1: the size of scaled rows
        self.w = np.zeros(r)
        self.G = self.V.T @ self.V
        self.K = K
        self.narrow, self.lost = False, False

    def lift(self, y: Array, near: Array | None = None) -> tuple[Array, Array]:
        """Solve for displacement and positions at independent coordinates y, from a scaled guess `near`.

        Raises:
            AssemblyError: The loops do not close there.
            AmbiguousBranchError: Another branch is too near.
        """
        rows, w, lengths = self.rows, self.w.copy() if near is None else self.V.T @ near, [np.inf]
        along = self.Z @ y
        for _ in range(MOST_STEPS):
            q = rows.moved(self.q, along + self.V @ w)
            residual, K = rows.at(q)
            open_by = float(np.abs(residual).max())
            G = self.U.T @ K @ self.V
            step = self._newton_step(G, residual)
            lengths.append(float(np.abs(step).max(initial=0.0)))
            if open_by <= CHART_ROUNDING and lengths[-1] > LAST_STEP:
                step, lengths[-1] = 0.0 * w, 0.0
            if lengths[-1] <= LAST_STEP or (lengths[-1] >= lengths[-2] and open_by <= rows.closed):
                if open_by > rows.closed:
                    break
                self._check_branch(G, lengths)
                self.w, self.G, self.K = w - step, G, K
                x = along + self.V @ self.w
                return rows.unit * x, rows.moved(self.q, x)
            w = w - step
            if not np.isfinite(lengths[-1]) or np.abs(w).max() > FARTHEST:
                break
        raise AssemblyError(
            f"module '{self.module.name}': its loops do not close {np.abs(along).max(initial=0.0):.2g} "
            f"(rad or module lengths) away along its free motions; {len(lengths) - 1} Newton steps left a "
            f"residual of {open_by:.2g} (limit {rows.closed:.0e}). The posture is out of reach, or the "
            "step too long",
            module=self.module.name,
            residual=open_by,
            iterations=len(lengths) - 1,
        )

    def _newton_step(self, G: Array, residual: Array) -> Array:
        """Compute the Newton step of the dependent coordinates."""
        try:
            return np.asarray(np.linalg.solve(G, self.U.T @ residual), dtype=float)
        except np.linalg.LinAlgError:
            if np.abs(residual).max() <= CHART_ROUNDING:
                return np.zeros(len(G))
            raise self._ambiguous() from None

    def _check_branch(self, G: Array, lengths: list[float]) -> None:
        """Check that Newton stayed on the branch; update `narrow` and `lost`."""
        s = np.linalg.svd(G, compute_uv=False) if len(G) else np.ones(1)
        usual = self.module.mechanism.reduction.report.kept
        self.narrow, self.lost = s[-1] <= NARROW * usual * s[0], s[-1] <= LOST_RATES * s[0]
        if self.narrow and len(lengths) > 2 and lengths[2] > CONTRACTION * lengths[1]:
            raise self._ambiguous()

    def _ambiguous(self) -> AmbiguousBranchError:
        name = self.module.name
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
                residual, K = self.rows.at(q)
                step = self.V @ (np.linalg.pinv(self.U.T @ K @ self.V, rcond=HELD) @ (self.U.T @ residual))
                q = self.rows.moved(q, -step)
                if np.abs(step).max() <= LAST_STEP:
                    break
            if np.abs(residual).max() <= self.rows.closed:
                return q
        return self.lift(np.zeros(self.Z.shape[1]), np.zeros(len(self.rows.unit)))[1]

    def rates(self, u: Array) -> Array:
        """Compute the scaled rates at the posture of the last `lift`, u of shape (N,) or (N, k).

        Where rank is lost, rows that are rounding are dropped, and rates keep the chart's direction.
        """
        along = self.Z @ u
        right = self.U.T @ (self.K @ along)
        solved = np.linalg.pinv(self.G, rcond=HELD) @ right if self.lost else np.linalg.solve(self.G, right)
        return along - self.V @ solved
