"""The constraint manifold of a robot: postures kept assembled, and the independent velocities of its modules.

A chart is laid at the start of a step and kept through it. With the scaled closure rows K of a module there,
K = U_1 s V_1^T on their rank, and Z the null space:

    xi = unit (Z y + V_1 w),    U_1^T residual(move(q_0, xi)) = 0      positions, solved for w by Newton
    v  = unit (Z u - V_1 G^-1 U_1^T K Z u),    G = U_1^T K V_1         rates: K v = 0 and Z^T v / unit = u

so y and u are the module's independent coordinates and velocities, and the paper's Psi is the matrix before
u. A module without loops has Z = 1. The base of a "moving" robot is prescribed and no part of a chart.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from .elimination import least_squares
from .errors import AssemblyError
from .joints import TRANSLATIONS
from .loop_rows import LoopRows
from .mechanism import Mechanism
from .module import Module
from .retraction import Retraction
from .robot import HybridRobot
from .spatial import Array

#: Newton stops once its step (rad, module lengths) is no more than this; the next one would be rounding.
LAST_STEP = 1e-12
#: Closures count as closed under this residual (relative to the module's length), on top of the file's
#: rounding.
CLOSED = 1e-11
#: Most Newton steps; a chart that needs more is left by a shorter time step.
MOST_STEPS = 20
#: A displacement of dependent coordinates beyond this (rad, module lengths) has left the chart.
FARTHEST = 1.0


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
        return CLOSED + self.module.mechanism.rounding


class Manifold:
    """All assembled postures of a robot.

    Attributes:
        robot: The robot.
        looped: Modules with loops.
        retraction: Moves on the whole spanning tree.
        unit: Unit of each freedom, shape (nv,).
        position_unit: Unit of each position coordinate, shape (nq,).
        mobility: Number of independent velocities.
    """

    def __init__(self, robot: HybridRobot) -> None:
        self.robot = robot
        self.retraction = Retraction(robot.kinds, robot.q_slices, robot.v_slices)
        self.unit = np.ones(robot.nv)
        if robot.base == "moving":
            self.unit[:3] = 2.0 ** np.round(np.log2(robot.bodies.size))
        self.looped: list[LoopedModule] = []
        self._shared: dict[int, LoopRows] = {}
        free = []
        for module in robot.modules:
            m = module.mechanism
            self.unit[module.v_index] = m.spanning_col_scale
            if m.spanning_closures.rows:
                self.looped.append(LoopedModule(module, self._rows(m), _retraction(m)))
            else:
                free += list(module.v_index)
        self.free = np.array(sorted(free), dtype=int)
        self.position_unit = np.ones(robot.nq)
        for kind, q, v in zip(robot.kinds, robot.q_slices, robot.v_slices, strict=True):
            slides = q.start + TRANSLATIONS.get(kind, 0)
            self.position_unit[q.start : slides] = self.unit[v.start]
        self.mobility = robot.mobility

    def _rows(self, mechanism: Mechanism) -> LoopRows:
        """Give the rows of a module, shared by equal modules."""
        if id(mechanism) not in self._shared:
            self._shared[id(mechanism)] = LoopRows(mechanism)
        return self._shared[id(mechanism)]

    def chart(self, q: Array, *, bound: bool = True) -> Chart:
        """Lay a chart about a posture.

        Args:
            q: Positions, shape (nq,); assembled, or close to it.
            bound: False for a chart of the whole tree, in which closures hold nothing.
        """
        return Chart(self, q, bound)

    def residual(self, q: Array) -> float:
        """Give the worst scaled closure residual of a posture, shape (nq,)."""
        return self.worst(q)[0]

    def worst(self, q: Array) -> tuple[float, str]:
        """Give the worst scaled closure residual of a posture, and the name of its module."""
        each = [(float(np.abs(m.rows.at(q[m.module.q_index])[0]).max()), m.module.name) for m in self.looped]
        return max(each, default=(0.0, ""))

    def pull_back(self, q: Array, v: Array, rate: float) -> Array:
        """Give Baumgarte's accelerations, shape (nv,): K a = -2 rate K v - rate^2 residual."""
        out = np.zeros_like(v)
        for m in self.looped:
            index, unit = m.module.v_index, m.rows.unit
            residual, K = m.rows.at(q[m.module.q_index])
            wanted = -2 * rate * K @ (v[index] / unit) - rate**2 * residual
            out[index] = unit * least_squares(K[None], wanted[None], rank=m.rows.rank)[0]
        return out

    def opening(self, q: Array, v: Array) -> tuple[float, str]:
        """Give how fast the loops open, relative to the rates, and the name of the worst module."""
        worst, name = 0.0, ""
        for m in self.looped:
            x = v[m.module.v_index] / m.rows.unit
            rate = np.abs(m.rows.at(q[m.module.q_index])[1] @ x).max()
            size = np.abs(x).max()
            if size > 0 and rate / size > worst:
                worst, name = float(rate / size), m.module.name
        return worst, name

    def project(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Give the closed posture near q, and the rates near v that keep it closed (least scaled change).

        Raises:
            AssemblyError: No closed posture was found.
        """
        away = self.chart(q)
        closed = away.lift(np.zeros(away.size), np.zeros(away.size)).q
        chart = self.chart(closed)
        return closed, self.with_base(v, chart.at_origin(chart.independent(v)))

    def with_base(self, v: Array, moved: Array) -> Array:
        """Give `moved` with the rates of a prescribed base taken from v."""
        if self.robot.base == "moving":
            moved[:6] = v[:6]
        return moved


class _Part:
    """A chart's share of one looped module."""

    def __init__(self, looped: LoopedModule, q: Array) -> None:
        self.looped, self.q = looped, q
        self.unit = looped.rows.unit
        _, K = looped.rows.at(q)
        r = looped.rows.rank
        U, s, Vt = np.linalg.svd(K)
        self.U, self.V, self.Z = U[:, :r], Vt[:r].T, Vt[r:].T
        self.pivot = float(s[r - 1] / s[0]) if r and s[0] > 0 else 1.0
        self.w = np.zeros(r)
        self.G = self.V.T @ self.V
        self.K = K

    def lift(self, y: Array) -> tuple[Array, Array]:
        """Give displacement and positions at independent coordinates y."""
        looped, w, before = self.looped, self.w.copy(), np.inf
        along = self.Z @ y
        for spent in range(1, MOST_STEPS + 1):  # noqa: B007 - the message says it
            xi = self.unit * (along + self.V @ w)
            q = looped.retraction.move(self.q, xi)
            residual, K = looped.rows.at(q)
            G = self.U.T @ K @ self.V
            step = np.linalg.solve(G, self.U.T @ residual) if len(w) else w
            length = float(np.abs(step).max(initial=0.0))
            if length <= LAST_STEP or (length >= before and np.abs(residual).max() <= looped.closed):
                if np.abs(residual).max() > looped.closed:
                    break
                self.w, self.G, self.K = w - step, G, K
                xi = self.unit * (along + self.V @ self.w)
                return xi, looped.retraction.move(self.q, xi)
            if not np.isfinite(length) or np.abs(w - step).max() > FARTHEST:
                break
            w, before = w - step, length
        raise AssemblyError(
            f"module '{looped.module.name}': its loops do not close {np.abs(along).max(initial=0.0):.2g} "
            f"(rad or module lengths) away along its free motions; {spent} Newton steps left a residual of "
            f"{np.abs(residual).max():.2g} (limit {looped.closed:.0e}). The posture is out of reach, or the "
            "step too long",
            module=looped.module.name,
            residual=float(np.abs(residual).max()),
            iterations=spent,
        )

    def rates(self, u: Array) -> Array:
        """Give the scaled rates at the posture that `lift` gave last, u of shape (N,) or (N, k)."""
        along = self.Z @ u
        out: Array = along - self.V @ np.linalg.solve(self.G, self.U.T @ (self.K @ along))
        return out


class Chart:
    """Independent coordinates about one posture.

    Attributes:
        q: The origin, shape (nq,).
        size: Number of independent coordinates.
        pivot: Least relative singular value of the closures that counts: near zero, they are about to lose
            rank.
    """

    def __init__(self, manifold: Manifold, q: Array, bound: bool) -> None:
        self._manifold, self.q = manifold, q.copy()
        self._looped = manifold.looped if bound else []
        held = [m.module.v_index for m in self._looped]
        first = 6 * (manifold.robot.base == "moving")
        self._free = manifold.free if bound else np.arange(first, manifold.robot.nv)
        self._parts = [_Part(m, q[m.module.q_index]) for m in self._looped]
        self._held = held
        ends = np.cumsum([len(self._free)] + [p.Z.shape[1] for p in self._parts])
        self._at = [slice(int(a), int(b)) for a, b in pairwise(ends)]
        self.size = int(ends[-1])
        self.pivot = min((p.pivot for p in self._parts), default=1.0)

    def independent(self, x: Array) -> Array:
        """Give the independent share of rates, accelerations or displacements, shape (nv,) or (nv, k)."""
        unit = self._manifold.unit if x.ndim == 1 else self._manifold.unit[:, None]
        scaled = x / unit
        return np.concatenate(
            [scaled[self._free]] + [p.Z.T @ scaled[i] for p, i in zip(self._parts, self._held, strict=True)]
        )

    def at_origin(self, u: Array) -> Array:
        """Give the rates at the chart's origin, shape (nv,) or (nv, k)."""
        return self._spread(u, [p.Z @ u[at] for p, at in zip(self._parts, self._at, strict=True)])

    def lift(self, y: Array, u: Array) -> Posture:
        """Give posture and rates at independent coordinates and velocities.

        Raises:
            AssemblyError: The loops do not close there.
        """
        unit = self._manifold.unit
        xi = np.zeros(len(unit))
        xi[self._free] = y[: len(self._free)] * unit[self._free]
        q = self._manifold.retraction.move(self.q, xi)
        for looped, part, index, at in zip(self._looped, self._parts, self._held, self._at, strict=True):
            xi[index], q[looped.module.q_index] = part.lift(y[at])
        return Posture(q, xi, self.rates(u))

    def rates(self, u: Array) -> Array:
        """Give the rates of u at the posture that `lift` gave last, shape (nv,) or (nv, k)."""
        return self._spread(u, [p.rates(u[at]) for p, at in zip(self._parts, self._at, strict=True)])

    def _spread(self, u: Array, held: list[Array]) -> Array:
        """Enter scaled shares into the whole robot's freedoms."""
        out = np.zeros((len(self._manifold.unit), *u.shape[1:]))
        out[self._free] = u[: len(self._free)]
        for index, x in zip(self._held, held, strict=True):
            out[index] = x
        return out * (self._manifold.unit if u.ndim == 1 else self._manifold.unit[:, None])


def _retraction(mechanism: Mechanism) -> Retraction:
    """Give the moves on a module's spanning tree."""
    tree = mechanism.spanning
    return Retraction([j.kind for j in tree.joints], tree.q_slices, tree.v_slices)
