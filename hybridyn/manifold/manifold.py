"""The manifold of a robot's assembled postures, and its charts: independent coordinates about one posture.

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

from dataclasses import dataclass

import numpy as np

from ..linkage.retraction import Retraction
from ..spatial import Array, slices
from ..structure.module import Module
from ..structure.robot import HybridRobot
from .loop_rows import ScaledLoopRows
from .module_chart import ModuleChart


class Manifold:
    """The manifold of all assembled postures of a robot.

    Attributes:
        looped: Modules with loops, and their closures, which equal modules share.
        free: Indices of the freedoms of modules without loops, shape (k,).
        retraction: Moves on the whole spanning tree.
        unit: Unit of each freedom, shape (nv,).
        position_unit: Unit of each position coordinate, shape (nq,).
    """

    def __init__(self, robot: HybridRobot) -> None:
        self.robot = robot
        self.retraction = Retraction(robot.kinds)
        self.unit = robot.unit
        self.looped: list[tuple[Module, ScaledLoopRows]] = []
        shared: dict[int, ScaledLoopRows] = {}
        free: list[int] = []
        for module in robot.modules:
            m = module.mechanism
            if not m.spanning_closures.rows:
                free += list(module.v_index)
                continue
            if id(m) not in shared:
                shared[id(m)] = ScaledLoopRows(m)
            self.looped.append((module, shared[id(m)]))
        self.free = np.array(sorted(free), dtype=int)
        self.position_unit = np.ones(robot.nq)
        for kind, q, v in zip(robot.kinds, robot.q_slices, robot.v_slices, strict=True):
            slides = q.start + kind.shift
            self.position_unit[q.start : slides] = self.unit[v.start]

    def chart(self, q: Array, v: Array | None = None) -> Chart:
        """Build a chart about a posture.

        Args:
            q: Positions, shape (nq,); assembled, or close to it.
            v: Rates, shape (nv,), which select the branch where closures lose rank.

        Raises:
            SingularityError: The rates are on none of the branches that meet at the posture.
        """
        return Chart(self, q, v)

    def residual(self, q: Array) -> tuple[float, str]:
        """Compute the largest scaled closure residual of a posture, shape (nq,), and its module's name."""
        each = [(float(np.abs(rows.at(q[m.q_index])[0]).max()), m.name) for m, rows in self.looped]
        return max(each, default=(0.0, ""))

    def opening(self, q: Array, v: Array, *, least: float = 0.0) -> tuple[float, str]:
        """Compute the largest closure rate relative to the joint rates, and the name of its module.

        The joint rates of a module count as at least `least` [rad/s].
        """
        worst, name = 0.0, ""
        for module, rows in self.looped:
            x = v[module.v_index] / rows.unit
            rate = np.abs(rows.at(q[module.q_index])[1] @ x).max()
            size = max(np.abs(x).max(), least)
            if size > 0 and rate / size > worst:
                worst, name = float(rate / size), module.name
        return worst, name

    def project(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Project q on a closed posture, and v on rates that keep it closed (least scaled change).

        Raises:
            AssemblyError: No closed posture was found.
        """
        away = self.chart(q, v)
        closed = away.close()
        chart = self.chart(closed, v)
        return closed, self.with_base(v, chart.at_origin(chart.independent(v)))

    def with_base(self, v: Array, moved: Array) -> Array:
        """Return `moved` with the rates of a prescribed base taken from v."""
        if self.robot.base == "moving":
            moved[:6] = v[:6]
        return moved


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


class Chart:
    """Independent coordinates about one posture.

    Attributes:
        q: The origin, shape (nq,).
        size: Number of independent coordinates.
        pivot: Smallest relative singular value within the rank: near zero, the closures are close to losing
            rank.
    """

    def __init__(self, manifold: Manifold, q: Array, v: Array | None) -> None:
        self._manifold, self.q = manifold, q.copy()
        self._held = [module.v_index for module, _ in manifold.looped]
        self._free = manifold.free
        self._parts = [
            ModuleChart(module, rows, q[module.q_index], None if v is None else v[module.v_index])
            for module, rows in manifold.looped
        ]
        _, *self._at = own = slices([len(self._free), *(p.Z.shape[1] for p in self._parts)])
        self.size = own[-1].stop
        self.pivot = min((p.pivot for p in self._parts), default=1.0)

    def independent(self, x: Array) -> Array:
        """Project rates, accelerations or displacements, (nv,) or (nv, k), on the independent coordinates."""
        unit = self._manifold.unit if x.ndim == 1 else self._manifold.unit[:, None]
        scaled = x / unit
        return np.concatenate(
            [scaled[self._free]] + [p.Z.T @ scaled[i] for p, i in zip(self._parts, self._held, strict=True)]
        )

    def at_origin(self, u: Array) -> Array:
        """Compute the rates at the chart's origin, shape (nv,) or (nv, k)."""
        return self._spread(u, [p.Z @ u[at] for p, at in zip(self._parts, self._at, strict=True)])

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
        for part in self._parts:
            q[part.module.q_index] = part.close()
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
        unit = self._manifold.unit
        xi = np.zeros(len(unit))
        xi[self._free] = y[: len(self._free)] * unit[self._free]
        q = self._manifold.retraction.move(self.q, xi)
        for part, index, at in zip(self._parts, self._held, self._at, strict=True):
            guess = None if near is None else near[index] / part.rows.unit
            xi[index], q[part.module.q_index] = part.lift(y[at], guess)
        return Posture(q, xi, self.rates(u))

    def rates(self, u: Array) -> Array:
        """Compute the rates of u at the posture of the last `lift`, shape (nv,) or (nv, k)."""
        return self._spread(u, [p.rates(u[at]) for p, at in zip(self._parts, self._at, strict=True)])

    def _spread(self, u: Array, held: list[Array]) -> Array:
        """Assemble the scaled parts into rates of the whole robot."""
        out = np.zeros((len(self._manifold.unit), *u.shape[1:]))
        out[self._free] = u[: len(self._free)]
        for index, x in zip(self._held, held, strict=True):
            out[index] = x
        return out * (self._manifold.unit if u.ndim == 1 else self._manifold.unit[:, None])
